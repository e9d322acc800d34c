// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/compress.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>

#include "maps/map_writer.hpp"
#include "parallel/encode_pipeline.hpp"
#include "parallel/survey.hpp"
#include "parallel/tile_plan.hpp"
#include "parallel/tile_set.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/lattice.hpp"
#include "slam_adapter/order_source.hpp"
#include "slam_adapter/rate_search.hpp"
#include "slam_adapter/schema_choice.hpp"

namespace mapcodec {
namespace {

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

Error with_file(const std::string& path, const Error& e) {
  if (e.message.find(path) != std::string::npos) return e;
  return make_error(e.code, path + ": " + e.message, e.offset);
}

TileSettings tile_settings(const CompressOptions& options) {
  TileSettings s;
  s.effort = options.effort;
  s.keep_counts = options.keep_counts;
  s.paper = options.paper;
  s.codec = options.promise == PromiseKind::lossless ? CodecId::lossless
            : options.promise == PromiseKind::paper  ? CodecId::paper
                                                     : CodecId::points;
  return s;
}

/// Whole-map errors from those of the tiles: sums weighted by points, so that no tile has to be looked at
/// again.
class ErrorSum {
 public:
  void add(const EncodedTile& t) {
    const auto n = static_cast<double>(t.input_points);
    points_ += n;
    squares_ += n * t.errors.rms_m * t.errors.rms_m;
    color_ += n * t.errors.color_error;
    density_ += n * t.errors.density_error;
    max_axis_ = std::max(max_axis_, t.errors.max_axis_error_m);
  }
  [[nodiscard]] TileErrors total() const {
    if (points_ == 0) return {};
    return {std::sqrt(squares_ / points_), max_axis_, color_ / points_, density_ / points_};
  }

 private:
  double points_ = 0, squares_ = 0, color_ = 0, density_ = 0, max_axis_ = 0;
};

/// One compression from the tiles on: may be repeated with a finer lattice if the first one misses an RMS
/// promise.
class Job {
 public:
  Job(PointSource& source, const std::string& path, const CompressOptions& options)
      : source_(source), path_(path), options_(options), arena_(options.threads) {}

  Result<CompressReport> run() {
    auto begin = Clock::now(), at = begin;
    MAPCODEC_TRY(look_at_source());
    report_.survey_seconds = lap(at);
    MAPCODEC_TRY(make_tiles());
    report_.tiling_seconds = lap(at);
    MAPCODEC_TRY(encode_until_kept());
    report_.seconds = lap(begin);
    report_.threads = arena_.threads();
    report_.points = survey_.points;
    report_.dropped_points = survey_.dropped;
    return std::move(report_);
  }

 private:
  Status look_at_source() {
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

  Status make_tiles() {
    TilePlanSettings plan;
    if (options_.tile_size_m > 0) plan.tile_size_m = options_.tile_size_m;
    plan.target_points = options_.promise == PromiseKind::paper ? kPaperTilePoints : kTilePoints;
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
    return {};
  }

  /// A voxel side that the promise will not go below, 0 where there is none.
  [[nodiscard]] double smallest_step() const {
    if (options_.promise == PromiseKind::max_error || options_.promise == PromiseKind::rms)
      return options_.promise_m;
    return 0;
  }

  static std::string folder_of(const std::string& path) {
    const auto parent = std::filesystem::path(path).parent_path();
    return parent.empty() ? "." : parent.string();
  }

  Status encode_until_kept() {
    MAPCODEC_TRY(find_target(1));
    MAPCODEC_TRY(refine_for_color());
    constexpr int kTries = 8;
    for (int i = 0;; ++i) {
      auto at = Clock::now();
      MAPCODEC_TRY(encode_once());
      report_.tiles_seconds += lap(at);
      MAPCODEC_ASSIGN(const bool kept, is_kept_or_adjust());
      if (kept) break;
      if (i + 1 == kTries)
        return make_error(ErrorCode::kPromiseBroken, "no voxel size was found that keeps the promise");
    }
    say_if_finer_for_color();
    say_if_color_misses();
    auto at = Clock::now();
    MAPCODEC_TRY(commit());
    report_.commit_seconds = lap(at);
    return {};
  }

  /// What was measured on the sample may be off for the whole map: then the lattice is made finer.
  Result<bool> is_kept_or_adjust() {
    const TileErrors total = errors_.total();
    if (has_target()) return meets_target_or_adjust();
    if (schema_.promise == PromiseKind::rms && total.rms_m > schema_.promise_value) {
      schema_.step_m *= 0.999 * schema_.promise_value / total.rms_m;
      return false;
    }
    const auto color = bounded_color();
    if (color && schema_.step_m > 0 && total.color_error > schema_.channels[*color].bound &&
        schema_.coordinates.kind != CoordinateFormat::Kind::fixed) {
      // Some tiles can do no better than their voxels allow: the others have to be better, and if that is not
      // enough, the voxels smaller.
      color_target_ *= std::min(0.98, schema_.channels[*color].bound / total.color_error);
      if (++color_tries_ > 1) schema_.step_m *= color_tries_ < 4 ? 0.85 : 0.6;
      return false;
    }
    return true;
  }

  [[nodiscard]] std::optional<std::size_t> bounded_color() const {
    for (std::size_t i = 0; i < schema_.channels.size(); ++i) {
      if (schema_.channels[i].info.name == "rgb" && schema_.channels[i].kept == ChannelKept::bounded)
        return i;
    }
    return std::nullopt;
  }

  /// Colours keep their bound too: voxels that hold too different ones are too large, whatever the positions
  /// allow.
  Status refine_for_color() {
    const auto color = bounded_color();
    const bool lattice = schema_.promise == PromiseKind::rms || schema_.promise == PromiseKind::max_error;
    if (!color || !lattice || has_target() || schema_.coordinates.kind == CoordinateFormat::Kind::fixed)
      return {};
    position_step_ = schema_.step_m;
    MAPCODEC_ASSIGN(schema_.step_m, find_step_for_color(*color, *tiles_, schema_, arena_));
    return {};
  }

  void say_if_finer_for_color() {
    if (!(schema_.step_m < position_step_)) return;
    report_.warnings.push_back(
        "voxels are " + millimetres(schema_.step_m) + " instead of " + millimetres(position_step_) +
        ", so that colours keep their bound (a larger --color-error makes the map smaller)");
  }

  /// On a source's own lattice voxels are not made finer for colour.
  void say_if_color_misses() {
    const auto color = bounded_color();
    if (!color || !(errors_.total().color_error > schema_.channels[*color].bound)) return;
    report_.warnings.push_back("the colour error is " + std::to_string(errors_.total().color_error) +
                               ", above the bound: points of different colours share a position");
  }

  static std::string millimetres(double m) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g mm", m * 1e3);
    return text;
  }

  [[nodiscard]] bool has_target() const { return options_.target_bits_per_point || options_.target_ratio; }
  [[nodiscard]] double target_bits() const {
    return options_.target_bits_per_point ? *options_.target_bits_per_point
                                          : *options_.target_ratio * 8 * double(raw_bytes_per_point(schema_));
  }

  /// --target-ratio and --target-bpp: the voxel size that gives the size, found on a sample of the tiles.
  /// @param correction  of the target, where the whole map took more or less than the sample said.
  Status find_target(double correction) {
    if (!has_target()) return {};
    MAPCODEC_ASSIGN(schema_.step_m, find_step_for_bits(target_bits() * correction, *tiles_, schema_,
                                                       tile_settings(options_), arena_, options_.stop));
    return {};
  }

  Result<bool> meets_target_or_adjust() {
    const double bits = 8 * double(payload_bytes_) / double(survey_.points - survey_.nonfinite);
    const double ratio = target_bits() / bits;
    // What was achieved is what is promised.
    schema_.promise_value = errors_.total().rms_m;
    if ((ratio > 0.98 && ratio < 1.02) || ++target_tries_ > 3) return true;
    correction_ *= ratio;
    MAPCODEC_TRY(find_target(correction_));
    return false;
  }

  Status encode_once() {
    errors_ = {};
    bounds_ = {};
    payload_bytes_ = 0;
    report_.geometry_bytes = 0;
    report_.tile_seconds.clear();
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
    MapSchema target = schema_;
    if (const auto color = bounded_color()) target.channels[*color].bound *= color_target_;
    return encode_tiles(*tiles_, target, tile_settings(options_), pipeline,
                        [this](const TileKey& key, EncodedTile&& t) { return store(key, std::move(t)); });
  }

  Status store(const TileKey& key, EncodedTile&& t) {
    errors_.add(t);
    bounds_.add(t.bounds);
    payload_bytes_ += t.bytes.size();
    report_.geometry_bytes += t.geometry_bytes;
    return writer_->add(key, static_cast<std::uint8_t>(t.codec), t.points, t.bounds, t.errors, t.bytes);
  }

  Status commit() {
    MapInfo info;
    info.schema = write_schema(schema_);
    info.origin = plan_.origin();
    info.tile_size_m = schema_.tile_size_m;
    info.input_points = survey_.points;
    info.input_bytes = options_.input_bytes;
    info.dropped_points = survey_.dropped;
    info.achieved = errors_.total();
    info.bounds = bounds_;
    MAPCODEC_TRY(writer_->set_info(std::move(info)));
    // No clock in the archive of a new map: the same input gives the same bytes.
    const auto revision = writer_->commit(0);
    return revision.ok() ? Status{} : Status(revision.error());
  }

  // A cube is split at 1.5 times this. Smaller tiles cost bits at their borders, larger ones time to the
  // first point.
  static constexpr double kTilePoints = 100000;
  // The paper's planes are those of a whole scan: as few cuts as memory and time allow.
  static constexpr double kPaperTilePoints = 1000000;

  PointSource& source_;
  const std::string path_;
  const CompressOptions& options_;
  Arena arena_;
  Survey survey_;
  TilePlan plan_;
  MapSchema schema_;
  std::unique_ptr<TileSet> tiles_;
  std::unique_ptr<MapWriter> writer_;
  ErrorSum errors_;
  Box bounds_;
  std::uint64_t payload_bytes_ = 0;
  double correction_ = 1;     // of the target size
  double position_step_ = 0;  // what the positions' promise alone would allow
  int target_tries_ = 0;
  double color_target_ = 1;  // share of the colour bound that tiles aim at
  int color_tries_ = 0;
  CompressReport report_;
};

Result<std::unique_ptr<PointSource>> open_inputs(const std::vector<std::string>& inputs,
                                                 const ReadOptions& options) {
  std::vector<std::unique_ptr<PointSource>> sources;
  for (const std::string& path : inputs) {
    MAPCODEC_ASSIGN(std::unique_ptr<PointSource> source, open_source(path, options));
    sources.push_back(std::move(source));
  }
  if (sources.size() == 1) return std::move(sources.front());
  return concatenate(std::move(sources));
}

}  // namespace

Result<CompressReport> compress(PointSource& source, const std::string& path,
                                const CompressOptions& options) {
  if (!options.keep_order) return Job(source, path, options).run();
  OrderSource ordered(source);
  return Job(ordered, path, options).run();
}

Result<CompressReport> compress_files(const std::vector<std::string>& inputs, const std::string& path,
                                      CompressOptions options) {
  std::error_code ignored;
  if (!options.overwrite && std::filesystem::exists(path, ignored)) {
    return make_error(ErrorCode::kCannotWrite, path + ": exists already (--force replaces it)");
  }
  ReadOptions read;
  read.keep_nonfinite = options.promise == PromiseKind::lossless;
  read.unit_m = options.unit_m;
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_inputs(inputs, read));
  for (const std::string& input : inputs) {
    MAPCODEC_ASSIGN(const std::uint64_t bytes, input_bytes(input));
    options.input_bytes += bytes;
  }
  auto report = compress(*source, path, options);
  if (!report.ok() && report.error().code == ErrorCode::kCannotWrite) return with_file(path, report.error());
  return report;
}

}  // namespace mapcodec
