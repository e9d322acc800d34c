// SPDX-License-Identifier: GPL-3.0-or-later
// One compression, from the first look at the source to the committed archive.
#pragma once

#include <memory>
#include <optional>

#include "parallel/arena.hpp"
#include "parallel/survey.hpp"
#include "parallel/tile_neighbors.hpp"
#include "parallel/tile_set.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/map_coding.hpp"

namespace mapcodec {

/// Looks at the source, cuts it into tiles, codes them all, and commits the archive. To be run once.
class CompressJob {
 public:
  /// All must outlive the job.
  CompressJob(PointSource& source, const std::string& path, const CompressOptions& options)
      : source_(source), path_(path), options_(options), arena_(options.threads) {}

  [[nodiscard]] Result<CompressReport> run();

 private:
  [[nodiscard]] Status look_at_source();
  [[nodiscard]] Status make_tiles();
  [[nodiscard]] double points_per_tile() const;
  [[nodiscard]] double smallest_step() const;
  [[nodiscard]] Status code(double share);
  [[nodiscard]] bool colors_dominate() const;
  [[nodiscard]] Status try_finer();
  void take_report();
  [[nodiscard]] Status commit();

  PointSource& source_;
  const std::string path_;
  const CompressOptions& options_;
  Arena arena_;
  Survey survey_;
  TilePlan plan_;
  MapSchema schema_;  // as asked
  std::unique_ptr<TileSet> tiles_;
  std::unique_ptr<TileNeighbors> neighbors_;
  std::optional<CodingInput> input_;
  std::unique_ptr<MapCoding> coding_;  // the best so far
  CompressReport report_;
};

}  // namespace mapcodec
