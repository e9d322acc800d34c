// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/plan_adjuster.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

// Where the map's RMS shall lie in shares of the promise: as little as possible below it, never above.
constexpr double kLeastRms = 0.95, kRmsAim = 0.992;
// At low rates the bits fall with the third power of the RMS: coming closer is worth another coding or two.
constexpr double kNearRms = 0.98;
constexpr int kTriesForNear = 3;

// Of the map's colour, in shares of its bound: where it shall lie, what is near enough (bits fall with about
// the fifth power of the error), and the range of slopes.
constexpr double kColorAim = 0.993, kNearColor = 0.985, kFirstSlope = 25, kLeastSlope = 0.1,
                 kMostSlope = 4000;
// How the error grows with the slope, and how far one guess may go.
constexpr double kColorExponent = 0.22, kColorLeap = 2, kColorFallBack = 0.7;
// What nobody asked for shall not come nearer than this to the least error that positions allow.
constexpr double kAboveLeast = 1.2;
constexpr int kColorTries = 4;

}  // namespace

PlanAdjuster::PlanAdjuster(const CompressOptions& options, MapSchema& schema, PlanChoice& choice,
                           double position_step_m)
    : options_(options),
      schema_(schema),
      choice_(choice),
      position_step_(position_step_m),
      searched_step_(choice.coded ? choice.plan.step_m : 0) {
  const auto color = bounded_color(schema);
  if (color && !has_target(options) && choice.plan.has_surfaces())
    color_slope_ = kFirstSlope * schema.channels[*color].bound;
}

bool PlanAdjuster::has_color_slope() const {
  return color_slope_ > 0 && choice_.plan.has_surfaces() && bounded_color(schema_).has_value();
}

void PlanAdjuster::say_what_color_cost(std::vector<std::string>& warnings) const {
  say_if_finer_for_color(warnings);
  say_if_color_misses(warnings);
}

/// What was measured on the sample may be off for the whole map: then the step is changed.
bool PlanAdjuster::is_kept_or_adjust(const CodedSum& coded) {
  coded_ = coded;
  if (has_target(options_)) return meets_target_or_adjust();
  const bool by_slope = has_color_slope();
  if (!by_slope || !positions_found_) {
    const bool kept = schema_.promise != PromiseKind::rms || meets_rms_or_adjust();
    if (!by_slope) return kept && meets_color_or_adjust();
    positions_found_ = kept || !choice_.plan.has_surfaces();
    return false;
  }
  const ColorState state = adjust_map_color(schema_.channels[*bounded_color(schema_)].bound);
  if (state == ColorState::finer_positions) positions_found_ = false;
  color_tries_ += state == ColorState::missed;
  return state == ColorState::met;
}

bool PlanAdjuster::meets_rms_or_adjust() {
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
PlanAdjuster::ColorState PlanAdjuster::adjust_map_color(double asked_bound) {
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
  // After many tries ever more is given, until the bound is kept.
  const double next = error > bound && color_tries_ > kColorTries ? kColorFallBack * color_slope_
                                                                  : color_secant_->next(color_slope_, error);
  color_slope_ = std::clamp(next, least, most);
  return ColorState::missed;
}

bool PlanAdjuster::meets_color_or_adjust() {
  const auto color = bounded_color(schema_);
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

void PlanAdjuster::say_if_finer_for_color(std::vector<std::string>& warnings) const {
  if (has_target(options_)) return;
  const bool surfaces = choice_.plan.has_surfaces();
  // Among surfaces the step follows the RMS and is nobody's promise: only what colour took from it counts.
  const bool finer = surfaces ? color_tries_ > 2 : choice_.plan.step_m < position_step_;
  if (!finer || !bounded_color(schema_)) return;
  const std::string what = surfaces ? "surfaces are coded in steps of " + millimetres(choice_.plan.step_m)
                                    : "voxels are " + millimetres(choice_.plan.step_m) + " instead of " +
                                          millimetres(position_step_);
  warnings.push_back(what +
                     ", so that colours keep their bound (a larger --color-error makes the map smaller)");
}

/// On a source's own lattice voxels are not made finer for colour.
void PlanAdjuster::say_if_color_misses(std::vector<std::string>& warnings) const {
  const auto color = bounded_color(schema_);
  const double error = coded_.errors().color_error;
  if (!color || !(error > schema_.channels[*color].bound)) return;
  warnings.push_back("the colour error is " + std::to_string(error).substr(0, 5) + ", above the bound: " +
                     (choice_.plan.has_surfaces() ? "a smaller --rms gives better colours"
                                                  : "points of different colours share a position"));
}

/// A bound that nobody asked for is not promised if it was not kept.
void PlanAdjuster::record_reachable_color() {
  const auto color = bounded_color(schema_);
  const double error = coded_.errors().color_error;
  if (options_.color_error_asked || !color || !(error > schema_.channels[*color].bound)) return;
  schema_.channels[*color].bound = std::ceil(error * 100 + 1) / 100;
}

/// What was achieved is what is promised.
bool PlanAdjuster::meets_target_or_adjust() {
  const double ratio = target_bits(options_, schema_) / coded_.bits_per_point();
  schema_.promise_value = coded_.rms_m();
  if ((ratio > 0.98 && ratio < 1.02) || ++target_tries_ > 6) return true;
  if (!secant_) secant_.emplace(target_bits(options_, schema_), -std::clamp(choice_.bits_slope, 0.3, 1.5));
  choice_.plan.step_m = secant_->next(choice_.plan.step_m, coded_.bits_per_point());
  return false;
}

}  // namespace mapcodec
