// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rate_search.hpp"

#include <algorithm>
#include <functional>

#include "mapcodec/codec/points_encoder.hpp"
#include "mapcodec/codec/tile_color.hpp"
#include "mapcodec/geometry/quantizer.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/log_secant.hpp"
#include "slam_adapter/trade_search.hpp"
#include "slam_adapter/whole_search.hpp"

namespace mapcodec {
namespace {

constexpr int kMostTries = 12;
constexpr std::size_t kFewPoints = 60000;  // for the first tries
constexpr std::size_t kTradePoints = 60000;
constexpr double kRmsAim = 0.992;                                 // of the promise
constexpr double kCloseEnough = 0.06, kCloseEnoughOnAll = 0.015;  // of the target; the rest is extrapolated
constexpr double kFinest = 1.0 / (1 << 20);                       // of the longest side of a piece
constexpr double kBitsPerStep =
    1.2;  // by how much the logarithm of the size falls with that of the step, usually

/// Mean over the sample's points of what `measure` gives for a piece (per point), measured in parallel.
Result<double> mean_over(const TileSample& sample, Arena& arena,
                         const std::function<Result<double>(const PointCloud&)>& measure) {
  std::vector<std::optional<Result<double>>> values(sample.pieces.size());
  TbbRunner(arena).run(values.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) values[i] = measure(sample.pieces[i]);
  });
  double total = 0, points = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!values[i]->ok()) return values[i]->error();
    total += **values[i] * double(sample.pieces[i].size());
    points += double(sample.pieces[i].size());
  }
  return total / points;
}

Result<double> color_floor_at(double step_m, std::size_t channel, const TileSample& sample,
                              const MapSchema& schema, Arena& arena) {
  const Quantizer lattice{schema.origin, step_m, schema.coordinates.kind};
  return mean_over(sample, arena, [&](const PointCloud& cloud) -> Result<double> {
    MAPCODEC_ASSIGN(const PointsEncoding e, encode_points(cloud.xyz, lattice, {Effort::fast, true}));
    Channel values{cloud.channels[channel].info, {}};
    values.data.resize(e.order.size() * values.info.stride());
    for (std::size_t i = 0; i < e.order.size(); ++i) {
      std::memcpy(values.at(i), cloud.channels[channel].at(e.order[i]), values.info.stride());
    }
    return least_color_error(values, {cloud.xyz, e.order, e.voxels, e.decoded});
  });
}

}  // namespace

Result<CodedSum> RateSearch::measure(const CodingPlan& plan) const {
  return encode_sample(sample_, positions_alone(schema_), plan, arena_, stop_);
}

Status RateSearch::seek_on(const TileSample& sample, CodingPlan& plan, const MapSchema& schema, Value value,
                           double target, const Range& steps, double& slope) {
  LogSecant secant(target, slope);
  // A small map is its own sample: being close there is being close.
  const double close = sample.whole ? kCloseEnoughOnAll : kCloseEnough;
  CodingPlan trial = plan;
  trial.tiles.rough_errors = true;
  for (int i = 0; i < kMostTries; ++i) {
    trial.step_m = plan.step_m;
    MapSchema with_step = schema;
    with_step.step_m = plan.step_m;
    MAPCODEC_ASSIGN(found_, encode_sample(sample, with_step, trial, arena_, stop_));
    surfaces_alone_ = surfaces_alone_ && found_.surface_share() == 1;
    const double got = (found_.*value)();
    const double next = std::clamp(secant.next(plan.step_m, got), steps.finest, steps.coarsest);
    slope = secant.slope();
    const double bits = found_.geometry_bits_per_point();
    expected_bits_ = bits * std::pow(next / plan.step_m, value == &CodedSum::rms_m ? -kBitsPerStep : slope);
    const bool at_end = next == plan.step_m;
    plan.step_m = next;
    // The last stretch needs no try: the slope is known.
    leapt_ = secant.is_leap();
    if (at_end || leapt_ || std::abs(got / target - 1) <= close) break;
  }
  return {};
}

/// Every try is a coding of the map: the best is taken as it is.
Status RateSearch::seek_whole(CodingPlan& plan, const MapSchema& schema, double rms_m, const Range& steps,
                              double& slope) {
  WholeSearch search(sample_, schema, arena_, stop_, rms_m, slope);
  MAPCODEC_ASSIGN(auto best, search.run(plan, {steps.finest, steps.coarsest}));
  slope = search.rms_slope();
  leapt_ = search.leapt();
  surfaces_alone_ = surfaces_alone_ && search.surfaces_alone();
  // Where no try kept the promise, the nearest step will do: the map's own coding goes on from there.
  if (!best) return seek_on(sample_, plan, schema, &CodedSum::rms_m, kRmsAim * rms_m, steps, slope);
  found_ = best->sum;
  plan = best->plan;
  coded_ = std::move(best->coded);
  expected_bits_ = found_.geometry_bits_per_point();
  return {};
}

/// Errors first on little, which gives the slope.
Status RateSearch::seek_rms(CodingPlan& plan, const MapSchema& schema, double rms_m, const Range& steps) {
  double slope = 0.5;
  coded_.reset();
  const double aim = kRmsAim * rms_m;
  if (sample_.points() > 2 * kFewPoints) {
    MAPCODEC_TRY(seek_on(sample_.part(kFewPoints), plan, schema, &CodedSum::rms_m, aim, steps, slope));
  }
  if (sample_.whole) {
    MAPCODEC_TRY(seek_whole(plan, schema, rms_m, steps, slope));
  } else {
    MAPCODEC_TRY(choose_trade(plan, schema, aim, steps));
    MAPCODEC_TRY(seek_on(sample_, plan, schema, &CodedSum::rms_m, aim, steps, slope));
  }
  rms_slope_ = std::abs(slope);
  return {};
}

Status RateSearch::choose_trade(CodingPlan& plan, const MapSchema& schema, double rms_m,
                                const Range& steps) const {
  if (!plan.has_surfaces() || plan.tiles.effort == Effort::fast) return {};
  const TileSample some = sample_.whole ? sample_.some(kTradePoints) : TileSample{};
  const MeasurePlan measure = [&](const CodingPlan& trial) {
    MapSchema with_step = schema;
    with_step.step_m = trial.step_m;
    return encode_sample(sample_.whole ? some : large_, with_step, trial, arena_, stop_);
  };
  MAPCODEC_ASSIGN(plan, TradeSearch(rms_m, measure).run(plan));
  plan.step_m = std::clamp(plan.step_m, steps.finest, steps.coarsest);
  return {};
}

/// Half a voxel is what its centre loses. What surfaces lose depends on how far the points lie apart.
double RateSearch::first_step(const CodingPlan& plan, double rms_m) const {
  const double spacings = sample_.spacing_m > 0 ? rms_m / sample_.spacing_m : 1;
  return rms_m * (plan.has_surfaces() ? std::clamp(1.1 * spacings, 0.5, 3.0) : 2.0);
}

/// Beyond the size of the whole nothing is lost by coarser steps any more, and nothing gained.
RateSearch::Range RateSearch::steps_for(double rms_m) const {
  return {rms_m / 16, 8 * std::max(sample_.side_m, rms_m)};
}

Result<CodingPlan> RateSearch::for_rms(CodingPlan plan, double rms_m) {
  plan.step_m = first_step(plan, rms_m);
  MAPCODEC_TRY(seek_rms(plan, positions_alone(schema_), rms_m, steps_for(rms_m)));
  return plan;
}

Result<std::optional<std::vector<TileTry>>> RateSearch::for_each_tile(CodingPlan& plan, double rms_m,
                                                                      bool with_points) {
  const MapSchema schema = positions_alone(schema_);
  plan.choice = CodecChoice::surface;
  plan.step_m = first_step(plan, rms_m);
  MAPCODEC_TRY(choose_trade(plan, schema, kRmsAim * rms_m, steps_for(rms_m)));
  const CodeTiles code = [&](std::span<const std::size_t> pieces, const TileSettings& settings) {
    return encode_pieces(sample_, pieces, schema, settings, arena_, stop_);
  };
  TileSettings surfaces = plan.tiles;
  surfaces.step_m = plan.step_m;
  const std::size_t tiles = sample_.pieces.size();
  MAPCODEC_ASSIGN(auto settled, search_mixture(tiles, rms_m, code, surfaces, with_points));
  plan.choice = CodecChoice::cheapest;
  const auto is_surface = [](const TileTry& t) { return t.settings.codec == CodecId::surface; };
  if (settled && std::none_of(settled->begin(), settled->end(), is_surface)) settled.reset();
  // The search of surfaces alone goes by other steps and weights, and may find a little more.
  if (settled && with_points && surfaces.effort != Effort::fast) {
    MAPCODEC_ASSIGN(auto alone, search_mixture(tiles, rms_m, code, surfaces, false));
    if (alone && cost_of(*alone, rms_m) < cost_of(*settled, rms_m)) return alone;
  }
  return settled;
}

Result<CodingPlan> RateSearch::for_bits(CodingPlan plan, double bits_per_point) {
  if (!(sample_.side_m > 0)) {
    plan.step_m = 1;  // all points equal: any step will do
    return plan;
  }
  const Range steps{sample_.side_m * kFinest, sample_.side_m / 8};
  plan.step_m = std::clamp(sample_.spacing_m, steps.finest, steps.coarsest);
  double slope = -1;
  MAPCODEC_TRY(seek_on(sample_, plan, schema_, &CodedSum::bits_per_point, bits_per_point, steps, slope));
  bits_slope_ = std::abs(slope);
  if (plan.step_m == steps.coarsest && found_.bits_per_point() > bits_per_point * (1 + kCloseEnough)) {
    return make_error(ErrorCode::kInvalidArgument,
                      "the asked size cannot be reached: channels take more than that alone");
  }
  return plan;
}

Result<double> find_step_for_color(std::size_t channel, double step_m, const TileSample& sample,
                                   const MapSchema& schema, Arena& arena) {
  // Room below the bound for what coding itself loses, and for tiles that the sample did not show.
  const double wanted = 0.8 * schema.channels[channel].bound;
  double fine = step_m / 64, coarse = step_m;
  MAPCODEC_ASSIGN(const double floor, color_floor_at(coarse, channel, sample, schema, arena));
  if (floor <= wanted) return coarse;
  for (int i = 0; i < 7; ++i) {
    const double middle = std::sqrt(fine * coarse);
    MAPCODEC_ASSIGN(const double error, color_floor_at(middle, channel, sample, schema, arena));
    (error <= wanted ? fine : coarse) = middle;
  }
  return fine;
}

}  // namespace mapcodec
