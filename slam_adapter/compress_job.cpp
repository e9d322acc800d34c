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

// Where the map's RMS shall lie in shares of the promise: as little as possible below it, never above.
constexpr double kLeastRms = 0.95, kRmsAim = 0.992;
// At low rates the bits fall with the third power of the RMS: coming closer is worth another coding or two.
constexpr double kNearRms = 0.98;
constexpr int kTriesForNear = 3;

// Of the map's colour, in shares of its bound: where it shall lie, what is near enough, and the range of
// slopes.
constexpr double kColorAim = 0.985, kNearColor = 0.96, kFirstSlope = 25, kLeastSlope = 0.1, kMostSlope = 4000;
// How the error grows with the slope, and how far one guess may go.
constexpr double kColorExponent = 0.22, kColorLeap = 2;
// What nobody asked for shall not come nearer than this to the least error that positions allow.
constexpr double kAboveLeast = 1.2;
constexpr int kColorTries = 4;
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
  if (choice_.coded) searched_step_ = choice_.plan.step_m;
  for (std::size_t i = 0; i < choice_.tiles.size(); ++i)
    chosen_.emplace(tiles_->tiles()[i].key, choice_.tiles[i]);
  if (const auto color = bounded_color(); color && !has_target() && choice_.plan.has_surfaces())
    color_slope_ = kFirstSlope * schema_.channels[*color].bound;
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
      has_target()
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
    if (is_kept_or_adjust()) break;
    if (i + 1 == kTries)
      return make_error(ErrorCode::kPromiseBroken, "no step was found that keeps the promise");
  }
  say_if_finer_for_color();
  say_if_color_misses();
  record_reachable_color();
  auto at = Clock::now();
  MAPCODEC_TRY(commit());
  report_.commit_seconds = lap(at);
  return {};
}

/// What was measured on the sample may be off for the whole map: then the step is changed.
bool CompressJob::is_kept_or_adjust() {
  if (has_target()) return meets_target_or_adjust();
  const bool by_slope = has_color_slope();
  if (!by_slope || !positions_found_) {
    const bool kept = schema_.promise != PromiseKind::rms || meets_rms_or_adjust();
    if (!by_slope) return kept && meets_color_or_adjust();
    positions_found_ = kept || !choice_.plan.has_surfaces();
    return false;
  }
  const ColorState state = adjust_map_color(schema_.channels[*bounded_color()].bound);
  if (state == ColorState::finer_positions) positions_found_ = false;
  color_tries_ += state == ColorState::missed;
  return state == ColorState::met;
}

bool CompressJob::meets_rms_or_adjust() {
  const double promise = schema_.promise_value, rms = coded_.rms_m();
  CodingPlan& plan = choice_.plan;
  if (!plan.has_surfaces()) {
    if (rms <= promise) return true;
    plan.step_m *= 0.999 * promise / rms;
    return false;
  }
  if (coded_.surface_share() == 0 && options_.codecs == CodecChoice::cheapest) {
    // No tile took surfaces after all: one voxel side for the whole map is simpler, and its error known
    // beforehand.
    plan.choice = CodecChoice::points;
    plan.step_m = position_step_;
    return false;
  }
  // The search has tried around it on the whole map.
  if (plan.step_m == searched_step_ && rms <= promise) return true;
  // A step of the map's size loses all it can; and colour may ask for finer steps than the positions.
  const bool can_be_coarser =
      plan.step_m < 4 * std::max(choice_.side_m, promise) && color_tries_ == 0 && rms_tries_ < 3;
  const double bits = coded_.bits_per_point();
  if (rms <= promise && bits < best_bits_) {
    best_bits_ = bits;
    best_step_ = plan.step_m;
  }
  if (rms <= promise && rms >= (rms_tries_ < kTriesForNear ? kNearRms : kLeastRms) * promise) return true;
  if (rms <= promise && !can_be_coarser) {
    const bool was_better = bits > best_bits_ && color_tries_ == 0;
    if (was_better) plan.step_m = best_step_;
    return !was_better;
  }
  // After colour had its say the search begins anew.
  if (!secant_ || color_tries_ > 0)
    secant_.emplace(kRmsAim * promise, std::clamp(choice_.rms_slope, 0.25, 1.2));
  plan.step_m = secant_->next(plan.step_m, rms);
  ++rms_tries_;
  return false;
}

/// All surface tiles save their last bit at one price in error: so bits go where they help most. Positions
/// are made finer only where no price is low enough and the bound was asked for.
CompressJob::ColorState CompressJob::adjust_map_color(double asked_bound) {
  const double error = coded_.errors().color_error;
  // Coming near what is least takes many bits for little: nobody asked for that.
  const double sensible = options_.color_error_asked ? 0 : kAboveLeast * coded_.least_color_error();
  const double bound = std::max(asked_bound, sensible);
  const double least = kLeastSlope * bound, most = kMostSlope * bound;
  if (error > bound && color_slope_ <= least) {
    if (!options_.color_error_asked) return ColorState::met;
    choice_.plan.step_m *= 0.8;
    color_secant_.reset();
    ++color_tries_;
    return ColorState::finer_positions;
  }
  if (error <= bound && (error >= kNearColor * bound || color_slope_ >= most || color_tries_ >= kColorTries))
    return ColorState::met;
  if (!color_secant_) color_secant_.emplace(kColorAim * bound, kColorExponent, kColorLeap);
  color_slope_ = std::clamp(color_secant_->next(color_slope_, error), least, most);
  if (error > bound && color_tries_ > kColorTries) color_slope_ = least;
  return ColorState::missed;
}

bool CompressJob::meets_color_or_adjust() {
  const auto color = bounded_color();
  CodingPlan& plan = choice_.plan;
  const double error = coded_.errors().color_error;
  if (!color || !(plan.step_m > 0) || !(error > schema_.channels[*color].bound)) return true;
  if (!plan.has_surfaces() && schema_.coordinates.kind == CoordinateFormat::Kind::fixed) return true;
  // Some tiles can do no better than their positions allow: the others have to be better, and if that is not
  // enough, the steps smaller.
  color_target_ *= std::min(0.98, schema_.channels[*color].bound / error);
  if (++color_tries_ > (plan.has_surfaces() ? 2 : 1)) plan.step_m *= color_tries_ < 5 ? 0.85 : 0.6;
  return false;
}

std::optional<std::size_t> CompressJob::bounded_color() const {
  for (std::size_t i = 0; i < schema_.channels.size(); ++i) {
    if (schema_.channels[i].info.name == "rgb" && schema_.channels[i].kept == ChannelKept::bounded) return i;
  }
  return std::nullopt;
}

void CompressJob::say_if_finer_for_color() {
  if (has_target()) return;
  const bool surfaces = choice_.plan.has_surfaces();
  // Among surfaces the step follows the RMS and is nobody's promise: only what colour took from it counts.
  const bool finer = surfaces ? color_tries_ > 2 : choice_.plan.step_m < position_step_;
  if (!finer || !bounded_color()) return;
  const std::string what = surfaces ? "surfaces are coded in steps of " + millimetres(choice_.plan.step_m)
                                    : "voxels are " + millimetres(choice_.plan.step_m) + " instead of " +
                                          millimetres(position_step_);
  report_.warnings.push_back(
      what + ", so that colours keep their bound (a larger --color-error makes the map smaller)");
}

/// On a source's own lattice voxels are not made finer for colour.
void CompressJob::say_if_color_misses() {
  const auto color = bounded_color();
  const double error = coded_.errors().color_error;
  if (!color || !(error > schema_.channels[*color].bound)) return;
  report_.warnings.push_back("the colour error is " + std::to_string(error).substr(0, 5) +
                             ", above the bound: " +
                             (choice_.plan.has_surfaces() ? "a smaller --rms gives better colours"
                                                          : "points of different colours share a position"));
}

/// A bound that nobody asked for is not promised if it was not kept.
void CompressJob::record_reachable_color() {
  const auto color = bounded_color();
  const double error = coded_.errors().color_error;
  if (options_.color_error_asked || !color || !(error > schema_.channels[*color].bound)) return;
  schema_.channels[*color].bound = std::ceil(error * 100 + 1) / 100;
}

/// What was achieved is what is promised.
bool CompressJob::meets_target_or_adjust() {
  const double ratio = target_bits(options_, schema_) / coded_.bits_per_point();
  schema_.promise_value = coded_.rms_m();
  if ((ratio > 0.98 && ratio < 1.02) || ++target_tries_ > 6) return true;
  if (!secant_) secant_.emplace(target_bits(options_, schema_), -std::clamp(choice_.bits_slope, 0.3, 1.5));
  choice_.plan.step_m = secant_->next(choice_.plan.step_m, coded_.bits_per_point());
  return false;
}

Status CompressJob::encode_once() {
  coded_ = {};
  bounds_ = {};
  report_.geometry_bytes = 0;
  report_.tile_seconds.clear();
  levels_->clear();
  schema_.step_m = choice_.plan.step_m;
  choice_.plan.tiles.color_slope = color_slope_;
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
  if (const auto color = bounded_color()) target.channels[*color].bound *= color_target_;
  // Only where the positions lie shows what colours cost there.
  const bool positions_only = has_color_slope() && !positions_found_;
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
  return has_color_slope() ? memory_.encode(*key, tile, target, plan) : encode_by_plan(tile, target, plan);
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
