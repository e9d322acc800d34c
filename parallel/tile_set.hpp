// SPDX-License-Identifier: GPL-3.0-or-later
// Second pass over a map: its points, tile by tile.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "mapcodec/cloud/point_stream.hpp"
#include "mapcodec/cloud/tile_key.hpp"
#include "parallel/arena.hpp"
#include "parallel/progress.hpp"
#include "parallel/tile_plan.hpp"

namespace mapcodec {

/// The occupied tiles of a map with their points, in memory or in a temporary file.
/// Threads: const use from many.
class TileSet {
 public:
  struct Entry {
    TileKey key;
    std::uint64_t points = 0;  ///< at least 1
  };
  /// How a TileSet holds its points.
  class Points {
   public:
    virtual ~Points() = default;
    [[nodiscard]] virtual Result<PointCloud> load(std::size_t i) const = 0;
    [[nodiscard]] virtual std::uint64_t spilled_bytes() const { return 0; }
  };

  TileSet(PointCloud layout, std::vector<Entry> tiles, std::unique_ptr<Points> points);

  /// In Morton order, each tile once.
  [[nodiscard]] const std::vector<Entry>& tiles() const { return tiles_; }
  /// Format and channels of every tile, no point.
  [[nodiscard]] const PointCloud& layout() const { return layout_; }
  /// Points of all tiles.
  [[nodiscard]] std::uint64_t points() const { return total_; }
  /// Bytes that went to the temporary file; 0 in memory.
  [[nodiscard]] std::uint64_t spilled_bytes() const { return points_->spilled_bytes(); }
  /// The points of tile `i` < tiles().size() in the order of the source, every bit of them.
  /// Errors: Unreadable, Truncated (temporary file); LimitExceeded when memory runs out.
  [[nodiscard]] Result<PointCloud> load(std::size_t i) const;

 private:
  PointCloud layout_;
  std::vector<Entry> tiles_;
  std::unique_ptr<Points> points_;
  std::uint64_t total_ = 0;
};

struct TileSetSettings {
  std::uint64_t memory_budget_bytes = std::uint64_t{2} << 30;  ///< of the whole program
  std::string temp_dir;                                        ///< empty: the system's
  Arena* arena = nullptr;                                      ///< nullptr: on the caller's thread
  ProgressCallback progress;
  const std::atomic<bool>* stop = nullptr;
};

/// Sorts a cloud that is in memory into the tiles of `plan`; keeps the cloud and adds 4 bytes per point.
/// Errors: Malformed if a point is in no tile; LimitExceeded; Cancelled.
[[nodiscard]] Result<TileSet> build_tiles(PointCloud cloud, const TilePlan& plan,
                                          const TileSetSettings& settings);

/// Rewinds `source` and sorts it into the tiles of `plan` through one temporary file, within about a quarter
/// of the memory budget (but at least 65,536 points at once). Errors: those of the source; Malformed if it
/// gives other points than at the survey; CannotWrite; LimitExceeded; Cancelled.
[[nodiscard]] Result<TileSet> build_tiles(PointSource& source, const TilePlan& plan,
                                          const TileSetSettings& settings);

}  // namespace mapcodec
