// SPDX-License-Identifier: GPL-3.0-or-later
// Which tile of a map that grows a point belongs to.
#pragma once

#include <optional>
#include <unordered_set>
#include <vector>

#include "mapcodec/cloud/tile_key.hpp"

namespace mapcodec {

/// The tiles of one submap, of one or several levels, and the rule for places that have none yet: the largest
/// cube up to `new_level` that overlaps no tile. Threads: one at a time.
class TileDirectory {
 public:
  /// @param origin       [m] corner of tile (0, 0, 0). @param tile_size_m  of level 0.
  /// @param new_level    of tiles in open space.
  TileDirectory(const Vec3& origin, double tile_size_m, std::uint8_t new_level)
      : origin_(origin), tile_size_m_(tile_size_m), new_level_(new_level) {}

  void add(const TileKey& key);
  /// Smaller tiles take the place of `key`: those of its parts that are added, and, as points come, the
  /// others.
  void split(const TileKey& key);
  /// The tile of `p`, added if it is new; unplaced for a point without a place; nothing where tile numbers
  /// leave 32 bits.
  [[nodiscard]] std::optional<TileKey> place(const Vec3& p);

 private:
  [[nodiscard]] std::optional<TileKey> find(const TileKey& cell) const;

  Vec3 origin_;
  double tile_size_m_;
  std::uint8_t new_level_;
  std::vector<std::uint8_t> levels_;                        // that occur
  std::unordered_set<TileKey, TileKeyHash> tiles_, above_;  // above_: cubes that hold smaller tiles
  std::optional<TileKey> last_cell_, last_;                 // points come in runs
};

}  // namespace mapcodec
