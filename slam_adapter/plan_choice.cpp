// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/plan_choice.hpp"

#include <algorithm>
#include <cstdio>

#include "slam_adapter/rate_search.hpp"
#include "slam_adapter/resampled_channels.hpp"

namespace mapcodec {
namespace {

// Far below the spacing positions have to be coded one by one, and the octree does it in fewer bits and
// faster.
constexpr double kHopelessForSurfaces = 0.25;
// Where points are this dear, the reader should know what a coarser promise would cost.
constexpr double kDearBits = 3;
// RMS that needs next to no bits for positions on a known surface, in spacings.
constexpr double kSamplingFloor = 1.1;

CodecId codec_of(PromiseKind promise) {
  return promise == PromiseKind::lossless ? CodecId::lossless
         : promise == PromiseKind::paper  ? CodecId::paper
                                          : CodecId::points;
}

/// The choice on one sample.
class Chooser {
 public:
  Chooser(const CompressOptions& options, const TileSample& sample, const TileSample& large,
          MapSchema& schema, Arena& arena, std::vector<std::string>& warnings)
      : options_(options),
        sample_(sample),
        large_(large),
        schema_(schema),
        arena_(arena),
        warnings_(warnings) {
    choice_.plan.choice = CodecChoice::points;
    choice_.plan.step_m = schema.step_m;
    choice_.plan.tiles.codec = codec_of(options.promise);
    choice_.plan.tiles.effort = options.effort;
    choice_.plan.tiles.keep_counts = options.keep_counts;
    choice_.plan.tiles.paper = options.paper;
    choice_.spacing_m = sample.spacing_m;
    choice_.side_m = sample.side_m;
  }

  Result<PlanChoice> choose() {
    MAPCODEC_TRY(has_target(options_) ? choose_for_bits() : choose_for_rms());
    if (!choice_.plan.has_surfaces() && !has_target(options_)) MAPCODEC_TRY(refine_for_color());
    schema_.step_m = choice_.plan.step_m;
    return choice_;
  }

 private:
  CodingPlan plan_with(CodecChoice codecs) const {
    CodingPlan plan = choice_.plan;
    plan.choice = codecs;
    return plan;
  }
  RateSearch search(const MapSchema& schema) const {
    return {sample_, large_, schema, arena_, options_.stop};
  }

  Status choose_for_rms() {
    const CodecChoice allowed = allowed_codecs(options_);
    if (allowed == CodecChoice::points) return {};
    const bool forced = allowed == CodecChoice::surface;
    const double rms_m = options_.promise_m;
    if (!forced && rms_m < kHopelessForSurfaces * sample_.spacing_m) return say_if_dear();
    const bool several = sample_.whole && sample_.pieces.size() > 1;
    bool found = false;
    if (several) {
      MAPCODEC_ASSIGN(found, found_for_each_tile(allowed, rms_m));
    }
    // What was asked for is found at one step for all tiles, or why not is said.
    if (!found && (forced || !several)) {
      MAPCODEC_ASSIGN(const std::optional<Found> best, best_for_rms(allowed, rms_m));
      if (best) take(best->plan, best->search);
      found = best.has_value();
    }
    if (!found) return say_if_dear();
    schema_.channels = resampled_channels(schema_, sample_, warnings_);
    return {};
  }

  /// A small map of several tiles was coded as a whole while it was searched.
  Result<bool> found_for_each_tile(CodecChoice allowed, double rms_m) {
    RateSearch s = search(schema_);
    CodingPlan plan = plan_with(allowed);
    MAPCODEC_ASSIGN(auto tiles, s.for_each_tile(plan, rms_m, allowed == CodecChoice::cheapest));
    if (!tiles) return false;
    choice_.plan = plan;
    choice_.coded.emplace();
    for (TileTry& t : *tiles) {
      choice_.tiles.push_back({t.settings.codec, plan.share_of(t.settings)});
      choice_.coded->tiles.push_back(std::move(t.coded));
      choice_.coded->seconds.push_back(t.seconds);
    }
    return true;
  }

  struct Found {
    CodingPlan plan;
    RateSearch search;
  };

  /// The fewest bits of the mixture and either codec alone: a mixture cannot come between the two where a
  /// tile that changes over takes much of the map with it. Nothing if that is `points`.
  Result<std::optional<Found>> best_for_rms(CodecChoice allowed, double rms_m) {
    // A map that is its own sample has one tile here, whose loss would leap from one codec to the other, or
    // is to have surfaces only.
    const bool alone = sample_.whole;
    Found mixed{{}, search(schema_)};
    MAPCODEC_ASSIGN(mixed.plan,
                    mixed.search.for_rms(plan_with(alone ? CodecChoice::surface : allowed), rms_m));
    const double share = mixed.search.found().surface_share();
    const bool clear = alone || (share == 1 && !mixed.search.leapt());
    if (allowed == CodecChoice::surface || (clear && mixed.search.expected_bits() < 0.5))
      return std::optional(mixed);
    MAPCODEC_ASSIGN(const CodedSum points, mixed.search.measure(choice_.plan));
    double least = points.geometry_bits_per_point();
    std::optional<Found> best;
    const auto consider = [&](const Found& f) {
      if (f.search.expected_bits() >= least) return;
      least = f.search.expected_bits();
      best.emplace(f);
    };
    if (!clear) {
      // Where no tile ever took points, surfaces alone would go the same way.
      Found surface = mixed.search.surfaces_alone() ? mixed : Found{{}, search(schema_)};
      if (mixed.search.surfaces_alone()) {
        surface.plan.choice = CodecChoice::surface;
      } else {
        CodingPlan surface_plan = plan_with(CodecChoice::surface);
        surface_plan.tiles.trade = mixed.plan.tiles.trade;
        MAPCODEC_ASSIGN(surface.plan, surface.search.for_rms(surface_plan, rms_m));
      }
      consider(surface);
    }
    if (share > 0 && (alone || !mixed.search.leapt() || sample_.pieces.size() > 1)) consider(mixed);
    return best;
  }

  Status choose_for_bits() {
    const CodecChoice allowed = allowed_codecs(options_);
    if (allowed != CodecChoice::points) {
      std::vector<std::string> said;
      MapSchema resampled = schema_;
      resampled.channels = resampled_channels(schema_, sample_, said);
      RateSearch s = search(resampled);
      const auto plan = s.for_bits(plan_with(allowed), target_bits(options_, resampled));
      if (allowed == CodecChoice::surface && !plan.ok()) return plan.error();
      // Colour within its bound can be dearer on resampled points, so much that only points meet the size.
      if (plan.ok() && (allowed == CodecChoice::surface || s.found().surface_share() > 0)) {
        take(*plan, s);
        schema_ = resampled;
        warnings_.insert(warnings_.end(), said.begin(), said.end());
        return {};
      }
    }
    RateSearch s = search(schema_);
    MAPCODEC_ASSIGN(const CodingPlan plan, s.for_bits(choice_.plan, target_bits(options_, schema_)));
    take(plan, s);
    return {};
  }

  void take(const CodingPlan& plan, const RateSearch& s) {
    choice_.plan = plan;
    choice_.rms_slope = s.rms_slope();
    choice_.bits_slope = s.bits_slope();
    choice_.coded = s.coded();
  }

  /// In one line: what this promise costs, and what one at the sampling floor would.
  Status say_if_dear() {
    if (options_.promise_m >= sample_.spacing_m) return {};
    RateSearch s = search(schema_);
    MAPCODEC_ASSIGN(const CodedSum now, s.measure(choice_.plan));
    if (now.geometry_bits_per_point() < kDearBits) return {};
    CodingPlan floor = plan_with(CodecChoice::surface);
    floor.step_m = kSamplingFloor * sample_.spacing_m;
    const auto there = s.measure(floor);
    char text[256];
    std::snprintf(
        text, sizeof text,
        "an RMS of %s is far below the distance of the points (%s) and takes about %.1f bits per point for "
        "positions",
        millimetres(options_.promise_m).c_str(), millimetres(sample_.spacing_m).c_str(),
        now.geometry_bits_per_point());
    std::string line = text;
    if (there.ok() && there->rms_m() > options_.promise_m) {
      std::snprintf(text, sizeof text, "; --rms %.2g would take about %.2g", there->rms_m(),
                    there->geometry_bits_per_point());
      line += text;
    }
    warnings_.push_back(line);
    return {};
  }

  /// Colours keep their bound too: voxels that hold too different ones are too large, whatever the positions
  /// allow.
  Status refine_for_color() {
    const auto color = bounded_color(schema_);
    const bool lattice = options_.promise == PromiseKind::rms || options_.promise == PromiseKind::max_error;
    if (!color || !lattice || schema_.coordinates.kind == CoordinateFormat::Kind::fixed) return {};
    MAPCODEC_ASSIGN(choice_.plan.step_m,
                    find_step_for_color(*color, schema_.step_m, sample_, schema_, arena_));
    return {};
  }

  const CompressOptions& options_;
  const TileSample &sample_, &large_;
  MapSchema& schema_;
  Arena& arena_;
  std::vector<std::string>& warnings_;
  PlanChoice choice_;
};

}  // namespace

bool has_target(const CompressOptions& o) {
  return o.target_bits_per_point || o.target_ratio;
}

std::optional<std::size_t> bounded_color(const MapSchema& schema) {
  for (std::size_t i = 0; i < schema.channels.size(); ++i) {
    if (schema.channels[i].info.name == "rgb" && schema.channels[i].kept == ChannelKept::bounded) return i;
  }
  return std::nullopt;
}

CodecChoice allowed_codecs(const CompressOptions& options) {
  return options.promise == PromiseKind::rms && options.keep_counts ? options.codecs : CodecChoice::points;
}

Result<PlanChoice> choose_plan(const CompressOptions& options, const TileSet& tiles, MapSchema& schema,
                               Arena& arena, std::vector<std::string>& warnings) {
  TileSample sample, large;
  // Without a lattice there is nothing to choose.
  if (options.promise == PromiseKind::rms || options.promise == PromiseKind::max_error) {
    MAPCODEC_ASSIGN(sample, take_sample(tiles, schema, arena));
  }
  if (!sample.whole && allowed_codecs(options) != CodecChoice::points) {
    MAPCODEC_ASSIGN(large, take_large_sample(tiles, schema, arena));
  }
  return Chooser(options, sample, large, schema, arena, warnings).choose();
}

double target_bits(const CompressOptions& options, const MapSchema& schema) {
  return options.target_bits_per_point ? *options.target_bits_per_point
                                       : *options.target_ratio * 8 * double(raw_bytes_per_point(schema));
}

std::string millimetres(double m) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g mm", m * 1e3);
  return text;
}

}  // namespace mapcodec
