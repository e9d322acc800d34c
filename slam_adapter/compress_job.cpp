// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/compress_job.hpp"

#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "parallel/encode_pipeline.hpp"
#include "parallel/runner.hpp"
#include "parallel/tile_plan.hpp"
#include "slam_adapter/schema_choice.hpp"

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

// Of the memory budget: for what codings of the same positions have in common.
constexpr std::uint64_t kMemoryShare = 8;

using Clock = std::chrono::steady_clock;

double lap(Clock::time_point& from) {
  const auto now = Clock::now();
  const double seconds = std::chrono::duration<double>(now - from).count();
  from = now;
  return seconds;
}

std::uint64_t memory_budget(const CompressOptions& options) {
  if (options.max_memory_bytes != 0) return options.max_memory_bytes;
  const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
  return pages > 0 && page > 0 ? std::uint64_t(pages) * std::uint64_t(page) / 2 : std::uint64_t{2} << 30;
}

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
  auto begin = Clock::now(), at = begin;
  MAPCODEC_TRY(look_at_source());
  report_.survey_seconds = lap(at);
  MAPCODEC_TRY(make_tiles());
  report_.tiling_seconds = lap(at);
  MAPCODEC_ASSIGN(choice_, choose_plan(options_, *tiles_, schema_, arena_, report_.warnings));
  report_.search_seconds = lap(at);
  for (std::size_t i = 0; i < choice_.tiles.size(); ++i)
    chosen_.emplace(tiles_->tiles()[i].key, choice_.tiles[i]);
  adjuster_.emplace(options_, schema_, choice_, position_step_);
  MAPCODEC_TRY(encode_until_kept());
  report_.seconds = lap(begin);
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
  position_step_ = schema_.step_m;
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
  levels_ = std::make_unique<LevelSampler>(*tiles_);
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

Status CompressJob::encode_until_kept() {
  constexpr int kTries = 16;
  for (int i = 0;; ++i) {
    auto at = Clock::now();
    MAPCODEC_TRY(encode_once());
    report_.tiles_seconds += lap(at);
    report_.codings = i + 1;
    if (adjuster_->is_kept_or_adjust(coded_)) break;
    if (i + 1 == kTries)
      return make_error(ErrorCode::kPromiseBroken, "no step was found that keeps the promise");
  }
  adjuster_->say_what_color_cost(report_.warnings);
  adjuster_->record_reachable_color();
  auto at = Clock::now();
  MAPCODEC_TRY(commit());
  report_.commit_seconds = lap(at);
  return {};
}

Status CompressJob::encode_once() {
  coded_ = {};
  bounds_ = {};
  report_.geometry_bytes = 0;
  report_.tile_seconds.clear();
  levels_->clear();
  schema_.step_m = choice_.plan.step_m;
  choice_.plan.tiles.color_slope = adjuster_->color_slope();
  MapInfo info;
  info.schema = write_schema(schema_);
  info.origin = plan_.origin();
  info.tile_size_m = schema_.tile_size_m;
  writer_.reset();
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::create(path_, info, options_.overwrite));
  writer_ = std::make_unique<MapWriter>(std::move(writer));
  PipelineSettings pipeline;
  pipeline.arena = &arena_;
  pipeline.memory_budget_bytes = memory_budget(options_);
  pipeline.progress = options_.progress;
  pipeline.stop = options_.stop;
  pipeline.tile_seconds = &report_.tile_seconds;
  if (is_coded()) return store_coded();
  MapSchema target = schema_;
  if (const auto color = bounded_color(schema_)) target.channels[*color].bound *= adjuster_->color_target();
  const bool positions_only = adjuster_->wants_positions_alone();
  if (positions_only) target = positions_alone(target);
  if (positions_only) memory_.begin(memory_budget(options_) / kMemoryShare);
  MAPCODEC_TRY(encode_tiles(
      *tiles_, [&](const PointCloud& tile) { return encode(tile, target); }, pipeline,
      [this](const TileKey& key, EncodedTile&& t) { return store(key, std::move(t)); }));
  add_saved_seconds();
  return {};
}

/// What a tile's coding takes is told as if nothing had been remembered.
void CompressJob::add_saved_seconds() {
  for (std::size_t i = 0; i < report_.tile_seconds.size(); ++i)
    report_.tile_seconds[i] += memory_.seconds_saved(tiles_->tiles()[i].key);
}

/// Whether the search has coded the whole map already: positions are all of it, and it was not coded since.
bool CompressJob::is_coded() const {
  const auto dropped = [](const ChannelSchema& c) { return c.kept == ChannelKept::dropped; };
  return report_.codings == 0 && choice_.coded && choice_.coded->tiles.size() == tiles_->tiles().size() &&
         std::all_of(schema_.channels.begin(), schema_.channels.end(), dropped);
}

Status CompressJob::store_coded() {
  for (std::size_t i = 0; i < tiles_->tiles().size(); ++i)
    MAPCODEC_TRY(store(tiles_->tiles()[i].key, std::move(choice_.coded->tiles[i])));
  report_.tile_seconds = choice_.coded->seconds;
  if (options_.progress)
    options_.progress({"encode", survey_.points, survey_.points, report_.geometry_bytes});
  choice_.coded.reset();
  return {};
}

/// Later codings keep to the codecs of the first: with a little other step some tiles would change over, and
/// the error of the map would leap to the other side of the promise.
Result<EncodedTile> CompressJob::encode(const PointCloud& tile, const MapSchema& target) {
  CodingPlan plan = choice_.plan;
  const auto key = plan_.tile_of(tile.xyz.front());
  if (!key) return encode_by_plan(tile, target, plan);
  plan.tiles.borders = neighbors_->borders_of(*key);
  const bool chosen = report_.codings > 0 || !choice_.tiles.empty();
  if (plan.choice == CodecChoice::cheapest && chosen) {
    const auto own = chosen_.find(*key);
    if (own != chosen_.end()) {
      plan.fixed = own->second.codec;
      plan.step_m *= own->second.step_share;
    }
  }
  return adjuster_->has_color_slope() ? memory_.encode(*key, tile, target, plan)
                                      : encode_by_plan(tile, target, plan);
}

Status CompressJob::store(const TileKey& key, EncodedTile&& t) {
  coded_.add(t);
  levels_->keep(key, t);
  if (choice_.tiles.empty()) chosen_.emplace(key, TileChoice{t.codec});
  bounds_.add(t.bounds);
  report_.geometry_bytes += t.geometry_bytes;
  return writer_->add(key, static_cast<std::uint8_t>(t.codec), t.points, t.bounds, t.errors, t.bytes);
}

Status CompressJob::commit() {
  MapInfo info;
  info.schema = write_schema(schema_);
  info.origin = plan_.origin();
  info.tile_size_m = schema_.tile_size_m;
  info.input_points = survey_.points;
  info.input_bytes = options_.input_bytes;
  info.dropped_points = survey_.dropped;
  info.achieved = coded_.errors();
  info.bounds = bounds_;
  TbbRunner runner(arena_);
  MAPCODEC_ASSIGN(const LevelErrors levels, levels_->measure(schema_, runner));
  if (levels.levels.size() > 1) info.extras[kLevelsExtra] = write_level_errors(levels);
  MAPCODEC_TRY(writer_->set_info(std::move(info)));
  if (options_.beside) MAPCODEC_TRY(options_.beside(*writer_));
  // No clock in the archive of a new map: the same input gives the same bytes.
  const auto revision = writer_->commit(0);
  return revision.ok() ? Status{} : Status(revision.error());
}

}  // namespace mapcodec
