// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <unordered_set>

#include "mapcodec/cloud/tile_borders.hpp"
#include "mapcodec/cloud/tile_key.hpp"
#include "parallel/tile_set.hpp"

namespace mapcodec {

/// Which tiles of a map lie side by side, whatever their levels. Threads: const use from many.
class TileNeighbors {
 public:
  /// @param origin, tile_size_m  of the plan that the tiles come from.
  TileNeighbors(const TileSet& tiles, const Vec3& origin, double tile_size_m);
  /// @param tiles  no two of which overlap; unplaced ones lie beside none.
  TileNeighbors(std::span<const TileKey> tiles, const Vec3& origin, double tile_size_m);
  /// The tile's cube, and the faces beyond which other tiles lie (or lie within a cube of its size).
  [[nodiscard]] TileBorders borders_of(const TileKey& key) const;

 private:
  [[nodiscard]] bool is_occupied(TileKey key) const;

  Vec3 origin_;
  double tile_size_m_;
  std::uint8_t highest_ = 0;  ///< level
  std::unordered_set<TileKey, TileKeyHash> tiles_, around_tiles_;
};

}  // namespace mapcodec
