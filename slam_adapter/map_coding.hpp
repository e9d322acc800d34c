// SPDX-License-Identifier: GPL-3.0-or-later
// All tiles of a map, coded so that it keeps what is asked: searched on a sample, then held on the whole.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "maps/map_writer.hpp"
#include "parallel/arena.hpp"
#include "parallel/tile_neighbors.hpp"
#include "parallel/tile_plan.hpp"
#include "parallel/tile_set.hpp"
#include "slam_adapter/coding_memory.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/level_errors.hpp"
#include "slam_adapter/plan_adjuster.hpp"
#include "slam_adapter/plan_choice.hpp"

namespace mapcodec {

/// What is coded, and where it is written to.
struct CodingInput {
  const TileSet& tiles;
  const TilePlan& plan;
  const TileNeighbors& neighbors;
  Arena& arena;
  std::string path;
};

/// Chooses a plan and codes the map by it, again with another step if the whole map misses what the sample
/// promised. Nothing is at the path before the writer's commit. To be run once.
class MapCoding {
 public:
  /// What `input` refers to must outlive it. @param schema  of choose_schema by these options.
  /// @param search_effort  for finding the plan; the options' is for coding by it.
  MapCoding(const CodingInput& input, const CompressOptions& options, MapSchema schema, Effort search_effort);

  /// Errors: those of choose_plan and of encoding; PromiseBroken; CannotWrite; Cancelled.
  [[nodiscard]] Status run();

  /// Both as coded. @{
  [[nodiscard]] const MapSchema& schema() const { return schema_; }
  [[nodiscard]] const CodedSum& coded() const { return coded_; }
  /// @}
  [[nodiscard]] const Box& bounds() const { return bounds_; }
  [[nodiscard]] bool has_surfaces() const { return choice_.plan.has_surfaces(); }
  [[nodiscard]] const LevelSampler& levels() const { return levels_; }
  /// Holds all tiles, and waits for the facts of the map.
  [[nodiscard]] MapWriter& writer() { return *writer_; }
  /// Its part of the report: sizes, times, codings, warnings.
  [[nodiscard]] const CompressReport& report() const { return report_; }
  /// Gives up the archive that it wrote, so that another coding can write one: there is one writer at a time.
  void drop_archive() { writer_.reset(); }
  /// Writes it again, the same bytes. Errors: as run.
  [[nodiscard]] Status write_again() { return encode_once(); }

 private:
  [[nodiscard]] Status encode_until_kept();
  [[nodiscard]] Status encode_once();
  [[nodiscard]] Status begin_archive();
  [[nodiscard]] Result<EncodedTile> encode(const PointCloud& tile, const MapSchema& target);
  void add_saved_seconds();
  [[nodiscard]] bool is_coded() const;
  [[nodiscard]] Status store_coded();
  [[nodiscard]] Status store(const TileKey& key, EncodedTile&& t);

  const CodingInput& input_;
  const CompressOptions options_;
  const Effort search_effort_;
  MapSchema schema_;
  double position_step_;  // what the positions' promise alone would allow
  LevelSampler levels_;
  std::unique_ptr<MapWriter> writer_;
  PlanChoice choice_;
  std::optional<PlanAdjuster> adjuster_;
  CodedSum coded_;
  std::map<TileKey, TileChoice, MortonLess> chosen_;  // for the tiles, by the search or their first coding
  Box bounds_;
  CodingMemory memory_;
  CompressReport report_;
};

/// Memory that a compression may take [bytes].
[[nodiscard]] std::uint64_t memory_budget(const CompressOptions& options);

}  // namespace mapcodec
