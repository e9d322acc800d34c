// SPDX-License-Identifier: GPL-3.0-or-later
// What codings of the same map have in common.
#pragma once

#include <map>
#include <mutex>
#include <optional>

#include "mapcodec/cloud/tile_key.hpp"
#include "mapcodec/codec/tile_memo.hpp"
#include "slam_adapter/coding_plan.hpp"

namespace mapcodec {

/// Remembers the tiles of one map between codings that differ in colours alone, as far as memory allows.
/// Nothing of what is coded depends on it. Threads: `encode` from many, but one at a time for a tile.
class CodingMemory {
 public:
  /// Forgets all. @param budget_bytes  for what is remembered.
  void begin(std::uint64_t budget_bytes);
  /// As encode_by_plan.
  [[nodiscard]] Result<EncodedTile> encode(const TileKey& key, const PointCloud& tile,
                                           const MapSchema& schema, const CodingPlan& plan);
  /// Processor time [s] of the positions that the last coding of this tile took from memory; 0: none.
  [[nodiscard]] double seconds_saved(const TileKey& key) const;

 private:
  struct Entry {
    TileMemo memo;                      ///< of a surface tile
    std::optional<EncodedTile> points;  ///< of another: surfaces' colours do not matter to it
    Bytes schema;                       ///< that `points` was coded for
    double seconds = 0, saved = 0;
  };
  Entry* entry_for(const TileKey& key, std::uint64_t points);

  mutable std::mutex mutex_;
  std::map<TileKey, Entry, MortonLess> entries_;
  std::uint64_t left_ = 0;
};

}  // namespace mapcodec
