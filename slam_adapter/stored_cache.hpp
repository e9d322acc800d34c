// SPDX-License-Identifier: GPL-3.0-or-later
// What is known of tiles between insertions.
#pragma once

#include <map>
#include <memory>

#include "slam_adapter/tile_work.hpp"

namespace mapcodec {

/// Decoded points of tiles under a budget of bytes; the tiles used longest ago go first. Threads: one at a
/// time.
class StoredCache {
 public:
  /// nullptr: not known.
  [[nodiscard]] std::shared_ptr<StoredPoints> find(const TilePlace& place) const;
  void keep(const TilePlace& place, std::shared_ptr<StoredPoints> points);
  void forget(const TilePlace& place) { tiles_.erase(place); }
  /// What is kept from now on is younger.
  void next_batch() { ++batch_; }
  void trim(std::uint64_t budget_bytes);

 private:
  struct Known {
    std::shared_ptr<StoredPoints> points;
    std::uint64_t used = 0;
  };
  std::map<TilePlace, Known, TilePlaceLess> tiles_;
  std::uint64_t batch_ = 0;
};

}  // namespace mapcodec
