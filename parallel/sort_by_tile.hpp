// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "mapcodec/base/runner.hpp"
#include "parallel/tile_plan.hpp"

namespace mapcodec {

/// Points [begin, end) of a tile-wise order.
struct TileRun {
  TileKey key;
  std::uint32_t begin = 0, end = 0;
  [[nodiscard]] std::uint32_t size() const { return end - begin; }
};

struct TileOrder {
  std::vector<std::uint32_t> order;  ///< indices of the points, tile after tile, in a tile by index
  std::vector<TileRun> runs;         ///< the occupied tiles, in Morton order
};

/// Counting sort of `points` (fewer than 2^32 - 1) by their tiles. The same for any runner.
/// Errors: Malformed if a point is in no tile of the plan. Throws what std and the runner throw.
[[nodiscard]] Result<TileOrder> sort_by_tile(const std::vector<Vec3>& points, const TilePlan& plan,
                                             Runner& runner);

}  // namespace mapcodec
