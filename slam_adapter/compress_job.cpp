// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/compress_job.hpp"

#include <algorithm>
#include <filesystem>

#include "parallel/runner.hpp"
#include "parallel/tile_plan.hpp"
#include "slam_adapter/schema_choice.hpp"
#include "slam_adapter/stopwatch.hpp"

namespace mapcodec {
namespace {

// A cube is split at 1.5 times this. Smaller tiles cost bits at their borders, larger ones time to the first
// point.
constexpr double kTilePoints = 100000;
// Surfaces take so few bits that what begins anew with each tile weighs more.
constexpr double kSurfaceTilePoints = 600000;
// The paper's planes are those of a whole scan: as few cuts as memory and time allow.
constexpr double kPaperTilePoints = 1000000;
// A target below this is one that only surfaces meet.
constexpr double kSurfaceBits = 3;

// Where positions take less than this share of the bytes, finer ones can save more of the colours than they
// cost: so much finer they are tried, and taken as long as the map is clearly smaller.
constexpr double kFewForPositions = 0.1, kFiner = 0.55, kClearlySmaller = 0.98;

std::string folder_of(const std::string& path) {
  const auto parent = std::filesystem::path(path).parent_path();
  return parent.empty() ? "." : parent.string();
}

/// Mean distance of neighbours [m], from the survey's thinned sample: on surfaces it falls with the root of
/// the number.
double rough_spacing(const Survey& survey) {
  if (survey.sample.empty()) return 0;
  return mean_spacing(survey.sample) * std::sqrt(double(survey.sample.size()) / double(survey.points));
}

}  // namespace

Result<CompressReport> CompressJob::run() {
  Stopwatch all, watch;
  MAPCODEC_TRY(look_at_source());
  report_.survey_seconds = watch.lap();
  MAPCODEC_TRY(make_tiles());
  report_.tiling_seconds = watch.lap();
  MAPCODEC_TRY(code(1));
  for (bool again = true; again && colors_dominate();) {
    const double bits = coding_->coded().bits_per_point();
    MAPCODEC_TRY(try_finer());
    again = coding_->coded().bits_per_point() < bits;
  }
  take_report();
  watch.lap();
  MAPCODEC_TRY(commit());
  report_.commit_seconds = watch.lap();
  report_.seconds = all.lap();
  report_.threads = arena_.threads();
  report_.points = survey_.points;
  report_.dropped_points = survey_.dropped;
  return std::move(report_);
}

Status CompressJob::look_at_source() {
  SurveySettings s;
  s.memory_budget_bytes = memory_budget(options_);
  s.arena = &arena_;
  s.progress = options_.progress;
  s.stop = options_.stop;
  MAPCODEC_ASSIGN(survey_, survey(source_, s));
  if (survey_.dropped > 0) {
    report_.warnings.push_back(std::to_string(survey_.dropped) +
                               " points without a finite position were dropped");
  }
  report_.warnings.insert(report_.warnings.end(), survey_.warnings.begin(), survey_.warnings.end());
  return {};
}

Status CompressJob::make_tiles() {
  TilePlanSettings plan;
  if (options_.tile_size_m > 0) plan.tile_size_m = options_.tile_size_m;
  plan.target_points = points_per_tile();
  const double step = smallest_step();
  if (step > 0) plan.max_side_m = step * double(1 << 20);
  MAPCODEC_ASSIGN(plan_, plan_tiles(survey_, plan));
  MAPCODEC_ASSIGN(schema_,
                  choose_schema(survey_, options_, plan_.origin(), plan_.tile_size_m(), report_.warnings));
  TileSetSettings s;
  s.memory_budget_bytes = memory_budget(options_);
  s.temp_dir = options_.temp_folder.empty() ? folder_of(path_) : options_.temp_folder;
  s.arena = &arena_;
  s.progress = options_.progress;
  s.stop = options_.stop;
  auto tiles =
      survey_.cloud ? build_tiles(std::move(*survey_.cloud), plan_, s) : build_tiles(source_, plan_, s);
  survey_.cloud.reset();
  if (!tiles.ok()) return tiles.error();
  tiles_ = std::make_unique<TileSet>(std::move(tiles).value());
  neighbors_ = std::make_unique<TileNeighbors>(*tiles_, schema_.origin, schema_.tile_size_m);
  input_.emplace(CodingInput{*tiles_, plan_, *neighbors_, arena_, path_});
  return {};
}

double CompressJob::points_per_tile() const {
  if (options_.promise == PromiseKind::paper) return kPaperTilePoints;
  if (allowed_codecs(options_) == CodecChoice::points) return kTilePoints;
  const bool coarse =
      has_target(options_)
          ? options_.target_bits_per_point.value_or(96 * options_.target_ratio.value_or(1)) < kSurfaceBits
          : options_.promise_m > rough_spacing(survey_);
  return coarse ? kSurfaceTilePoints : kTilePoints;
}

/// A voxel side that the promise will not go below, 0 where there is none.
double CompressJob::smallest_step() const {
  if (options_.promise == PromiseKind::max_error || options_.promise == PromiseKind::rms)
    return options_.promise_m;
  return 0;
}

/// Codes the map so that its error is at most this share of what is asked.
Status CompressJob::code(double share) {
  CompressOptions options = options_;
  options.promise_m *= share;
  MapSchema schema = schema_;
  schema.promise_value *= share;
  // Where positions are few of the bytes there is little to find.
  auto coding = std::make_unique<MapCoding>(*input_, options, std::move(schema),
                                            share == 1 ? options.effort : Effort::fast);
  const Status status = coding->run();
  const CompressReport& r = coding->report();
  report_.search_seconds += r.search_seconds;
  report_.tiles_seconds += r.tiles_seconds;
  report_.codings += r.codings;
  if (status.ok()) coding_ = std::move(coding);
  return status;
}

/// Whether the bytes are nearly all for colours.
bool CompressJob::colors_dominate() const {
  return options_.promise == PromiseKind::rms && !has_target(options_) && options_.effort != Effort::fast &&
         bounded_color(coding_->schema()) && coding_->has_surfaces() &&
         coding_->coded().geometry_bits_per_point() < kFewForPositions * coding_->coded().bits_per_point();
}

/// Tries finer positions, and keeps them if the map is clearly smaller so.
Status CompressJob::try_finer() {
  auto before = std::move(coding_);
  before->drop_archive();
  const Status status = code(kFiner * before->schema().promise_value / schema_.promise_value);
  if (!status.ok() && status.error().code != ErrorCode::kPromiseBroken) return status.error();
  const double color_error = std::max(options_.color_error, before->coded().errors().color_error);
  const bool smaller = status.ok() && coding_->coded().errors().color_error <= color_error &&
                       coding_->coded().bits_per_point() < kClearlySmaller * before->coded().bits_per_point();
  if (smaller) return {};
  coding_.reset();
  coding_ = std::move(before);
  return coding_->write_again();
}

void CompressJob::take_report() {
  const CompressReport& r = coding_->report();
  report_.geometry_bytes = r.geometry_bytes;
  report_.tile_seconds = r.tile_seconds;
  report_.warnings.insert(report_.warnings.end(), r.warnings.begin(), r.warnings.end());
  if (coding_->schema().promise_value < schema_.promise_value && options_.promise == PromiseKind::rms &&
      !has_target(options_))
    report_.warnings.push_back("positions are kept within an RMS of " +
                               millimetres(coding_->schema().promise_value) +
                               ": finer ones make the colours, and the map, smaller");
}

Status CompressJob::commit() {
  MapSchema schema = coding_->schema();
  if (!has_target(options_)) schema.promise_value = schema_.promise_value;
  MapInfo info;
  info.schema = write_schema(schema);
  info.origin = plan_.origin();
  info.tile_size_m = schema.tile_size_m;
  info.input_points = survey_.points;
  info.input_bytes = options_.input_bytes;
  info.dropped_points = survey_.dropped;
  info.achieved = coding_->coded().errors();
  info.bounds = coding_->bounds();
  TbbRunner runner(arena_);
  MAPCODEC_ASSIGN(const LevelErrors levels, coding_->levels().measure(schema, runner));
  if (levels.levels.size() > 1) info.extras[kLevelsExtra] = write_level_errors(levels);
  MapWriter& writer = coding_->writer();
  MAPCODEC_TRY(writer.set_info(std::move(info)));
  if (options_.beside) MAPCODEC_TRY(options_.beside(writer));
  // No clock in the archive of a new map: the same input gives the same bytes.
  const auto revision = writer.commit(0);
  return revision.ok() ? Status{} : Status(revision.error());
}

}  // namespace mapcodec
