// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "parallel/sort_by_tile.hpp"
#include "parallel/spill_file.hpp"
#include "parallel/tile_set.hpp"

namespace mapcodec {

/// Points of a TileSet in a temporary file. While it is built, points gather in one batch; a full batch is
/// sorted by tile and written as one chunk per tile, so a tile is a few chunks and the disk sees long writes.
class SpilledPoints final : public TileSet::Points {
 public:
  SpilledPoints(PointCloud layout, SpillFile file) : layout_(std::move(layout)), file_(std::move(file)) {}

  /// Before the first `add`. Plan and runner must live until `finish`.
  void begin(const TilePlan& plan, Runner& runner, std::uint64_t memory_budget_bytes);
  /// Errors: Malformed (point in no tile), CannotWrite.
  [[nodiscard]] Status add(const PointCloud& block);
  /// The tiles in Morton order; from now on `load` works. Errors: as `add`.
  [[nodiscard]] Result<std::vector<TileSet::Entry>> finish();

  [[nodiscard]] Result<PointCloud> load(std::size_t i) const override;
  [[nodiscard]] std::uint64_t spilled_bytes() const override { return end_; }

 private:
  /// Points of one tile that lie together: all xyz, then each channel.
  struct Chunk {
    std::uint64_t offset = 0;
    std::uint32_t points = 0;
    bool wide = false;  ///< xyz are doubles, not floats
  };
  [[nodiscard]] Status flush();
  [[nodiscard]] Status write_runs(const TileOrder& order, bool wide);
  void list_chunks(const TileOrder& order, bool wide);
  [[nodiscard]] std::uint64_t record_size(bool wide) const;
  [[nodiscard]] Status read_chunk(const Chunk& chunk, PointCloud& tile, Bytes& buffer) const;

  PointCloud layout_;
  SpillFile file_;
  std::uint64_t end_ = 0;  // of the file
  KeyIndex index_;
  std::vector<std::vector<Chunk>> chunks_;  // per tile, in the order of index_, then of the tiles
  PointCloud batch_;
  std::size_t batch_points_ = 0;
  const TilePlan* plan_ = nullptr;
  Runner* runner_ = nullptr;
};

}  // namespace mapcodec
