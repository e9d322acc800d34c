// SPDX-License-Identifier: GPL-3.0-or-later
// One compression, from the first look at the source to the committed archive.
#pragma once

#include <chrono>
#include <map>
#include <memory>

#include "maps/map_writer.hpp"
#include "parallel/arena.hpp"
#include "parallel/survey.hpp"
#include "parallel/tile_neighbors.hpp"
#include "parallel/tile_set.hpp"
#include "slam_adapter/coding_memory.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/level_errors.hpp"
#include "slam_adapter/plan_adjuster.hpp"

namespace mapcodec {

/// Looks at the source, cuts it into tiles, chooses how to code them, and codes them all; again with another
/// step if the whole map misses what the sample promised. To be run once.
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
  [[nodiscard]] Status encode_until_kept();
  [[nodiscard]] Status encode_once();
  [[nodiscard]] Result<EncodedTile> encode(const PointCloud& tile, const MapSchema& target);
  void add_saved_seconds();
  [[nodiscard]] bool is_coded() const;
  [[nodiscard]] Status store_coded();
  [[nodiscard]] Status store(const TileKey& key, EncodedTile&& t);
  [[nodiscard]] Status commit();

  PointSource& source_;
  const std::string path_;
  const CompressOptions& options_;
  Arena arena_;
  Survey survey_;
  TilePlan plan_;
  MapSchema schema_;
  std::unique_ptr<TileSet> tiles_;
  std::unique_ptr<TileNeighbors> neighbors_;
  std::unique_ptr<LevelSampler> levels_;
  std::unique_ptr<MapWriter> writer_;
  PlanChoice choice_;
  CodedSum coded_;
  std::map<TileKey, TileChoice, MortonLess> chosen_;  // for the tiles, by the search or their first coding
  Box bounds_;
  double position_step_ = 0;  // what the positions' promise alone would allow
  std::optional<PlanAdjuster> adjuster_;
  CodingMemory memory_;
  CompressReport report_;
};

}  // namespace mapcodec
