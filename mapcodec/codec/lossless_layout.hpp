// SPDX-License-Identifier: GPL-3.0-or-later
// Encoder side: on which grids the axes of a lossless tile are cut, and how coarsely.
#pragma once

#include <span>
#include <vector>

#include "mapcodec/codec/lossless_grid.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// A tile's finite points in coding order, cut into cells.
struct LosslessLayout {
  std::array<AxisGrid, 3> grids;
  std::array<std::int64_t, 3> base{};  ///< cell of voxel 0
  std::uint32_t depth = 0;             ///< octree levels
  std::vector<std::uint32_t> order;    ///< indices into the input
  std::vector<std::uint64_t> keys;     ///< Morton key of each point of `order`, ascending
};

/// @param finite  indices of the points of `xyz` to lay out; not empty.
[[nodiscard]] LosslessLayout lay_out_lossless(std::span<const Vec3> xyz,
                                              const std::vector<std::uint32_t>& finite,
                                              const CoordinateFormat& format, Effort effort);

}  // namespace mapcodec
