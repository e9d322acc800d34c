// SPDX-License-Identifier: GPL-3.0-or-later
// The choices of a surface tree: least squared error + lambda x bits, by recursion. Encoder only.
#pragma once

#include "mapcodec/codec/surface_coverage.hpp"
#include "mapcodec/codec/surface_walk.hpp"
#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec::surface {

/// Chooses cells, planes and wedges for `points` (Morton-sorted with x as the highest bit of each triple,
/// below 2^depth units).
/// @param models  what symbols are expected to cost.
/// @return choices[0] is the root's.
[[nodiscard]] std::vector<Choice> choose_cells(std::span<const Units> points, unsigned depth, Models& models,
                                               const SurfaceTrade& trade);

}  // namespace mapcodec::surface
