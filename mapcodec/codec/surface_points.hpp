// SPDX-License-Identifier: GPL-3.0-or-later
// Leaves of a surface tree to points (FORMAT.md 10.5).
#pragma once

#include "mapcodec/codec/surface_seams.hpp"

namespace mapcodec::surface {

inline constexpr int kSubUnitBits = 4;  ///< decoded points lie on a lattice of 1/16 of a unit

/// A decoded position [1/16 unit from the tile's base].
using SubUnits = std::array<std::int32_t, 3>;

/// Appends the points of one leaf. @param scratch  any; reused.
void append_points(const Leaf& leaf, const Surroundings& around, std::vector<Vertex>& scratch,
                   std::vector<SubUnits>& out);

}  // namespace mapcodec::surface
