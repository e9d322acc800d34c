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
#include "slam_adapter/log_secant.hpp"
#include "slam_adapter/plan_choice.hpp"

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

  [[nodiscard]] bool has_target() const { return options_.target_bits_per_point || options_.target_ratio; }
  [[nodiscard]] std::optional<std::size_t> bounded_color() const;
  /// Colours of surface tiles are coded to a slope of the whole map.
  [[nodiscard]] bool has_color_slope() const {
    return color_slope_ > 0 && choice_.plan.has_surfaces() && bounded_color().has_value();
  }
  bool is_kept_or_adjust();
  bool meets_target_or_adjust();
  bool meets_rms_or_adjust();
  bool meets_color_or_adjust();
  enum class ColorState { met, missed, finer_positions };
  ColorState adjust_map_color(double asked_bound);
  void say_if_finer_for_color();
  void say_if_color_misses();
  void record_reachable_color();

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
  double position_step_ = 0;                     // what the positions' promise alone would allow
  double searched_step_ = 0;                     // where the search ended on the whole map; 0: it did not
  double best_step_ = 0, best_bits_ = INFINITY;  // of the codings that kept the promise, the smallest
  std::optional<LogSecant> secant_;              // over the codings of the whole map
  int target_tries_ = 0, rms_tries_ = 0, color_tries_ = 0;
  std::optional<LogSecant> color_secant_;
  double color_slope_ = 0;        // of surface tiles, the same for all; 0: each meets the bound
  bool positions_found_ = false;  // until then colours are not coded where they follow a slope
  CodingMemory memory_;
  double color_target_ = 1;  // share of the colour bound that tiles aim at
  CompressReport report_;
};

}  // namespace mapcodec
