// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/codec/paper_mesh.hpp"

namespace mapcodec::paper {

/// Entropy-codes planes (FORMAT.md 7.3). Every triangle has an area and at least one point, every
/// plane a triangle; coordinates within +-kMaxLattice. An edge belongs to at most two triangles.
/// @param color_step  colours are rounded to multiples of this; 0: no colour.
[[nodiscard]] Bytes encode_planes(std::span<const LatticePlane> planes, std::uint32_t color_step);

}  // namespace mapcodec::paper
