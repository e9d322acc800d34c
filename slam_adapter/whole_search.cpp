// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/whole_search.hpp"

#include <random>

#include "parallel/runner.hpp"
#include "slam_adapter/log_secant.hpp"
#include "slam_adapter/surface_trades.hpp"

namespace mapcodec {
namespace {

// The first trade tells the slope; of others it shows soon whether they are better.
constexpr int kTries = 6, kTriesOfOthers = 2, kTriesForNear = 3;
constexpr double kAim = 0.992, kNear = 0.98, kLeast = 0.95, kSpent = 0.997;  // of the promise
constexpr double kAimNear = 0.985;                                           // so that most of them keep it
// Where the promise is not spent, coarser steps are tried: errors do not grow evenly with them.
constexpr double kCoarser[] = {1.01, 1.02, 1.04, 1.07};
// So many plans near the best are tried side by side, whatever the number of threads; and so many times,
// unless nothing clearly better has come for a while. The last two are for high effort.
constexpr std::size_t kBrood = 4;
constexpr int kBroods = 6, kPatience = 2, kBroodsOfHigh = 10, kPatienceOfHigh = 3;
constexpr double kClearlyBetter = 0.995;  // of the best score before
// How far they lie, as logarithms. A tile of few cells leaps by several hundredths in size and error where a
// setting moves by one.
constexpr double kPriceSpread = 0.15, kWeightSpread = 0.15, kStepSpread = 0.02;

}  // namespace

double WholeSearch::score_of(const CodedSum& sum) const {
  const double bits = sum.geometry_bits_per_point();
  return bits + worth_of_density(bits, sum.errors().density_error, rms_m_);
}

Result<WholeSearch::Kept> WholeSearch::code(const CodingPlan& plan) const {
  MapSchema with_step = schema_;
  with_step.step_m = plan.step_m;
  Kept r{plan, {}, {}};
  MAPCODEC_ASSIGN(r.sum, encode_sample(sample_, with_step, plan, arena_, stop_, &r.coded));
  r.score = score_of(r.sum);
  return r;
}

void WholeSearch::look_at(Kept&& tried) {
  last_ = tried.sum;
  surfaces_alone_ = surfaces_alone_ && last_.surface_share() == 1;
  if (last_.rms_m() > rms_m_) return;
  if (!best_ || tried.score < best_->score) best_ = std::move(tried);
}

Status WholeSearch::try_plan(const CodingPlan& plan) {
  MAPCODEC_ASSIGN(Kept tried, code(plan));
  look_at(std::move(tried));
  return {};
}

/// @param plan  its step is where to begin, and then the one that keeps the promise, if any was found.
Result<Tried> WholeSearch::try_steps(CodingPlan& plan, const Range& steps) {
  LogSecant secant(kAim * rms_m_, slope_);
  Tried least;
  CodingPlan trial = plan;
  const int tries = first_ ? kTries : kTriesOfOthers;
  first_ = false;
  for (int i = 0; i < tries; ++i) {
    MAPCODEC_TRY(try_plan(trial));
    const double share = last_.rms_m() / rms_m_;
    if (share <= 1 && score_of(last_) < least.cost) {
      least = {score_of(last_), last_.forward_to_backward()};
      plan.step_m = trial.step_m;
    }
    // At first only what comes near to the promise, later what is not far below.
    leapt_ = false;
    if (share <= 1 && share >= (i < kTriesForNear ? kNear : kLeast)) break;
    const double next =
        std::clamp(secant.next(trial.step_m, last_.rms_m()), steps.finest_m, steps.coarsest_m);
    slope_ = secant.slope();
    leapt_ = secant.is_leap();
    if (leapt_ || next == trial.step_m) break;
    trial.step_m = next;
  }
  return least;
}

Status WholeSearch::try_coarser(double coarsest_m) {
  const double found = best_->plan.step_m;
  for (const double coarser : kCoarser) {
    if (best_->sum.rms_m() >= kSpent * rms_m_) break;
    CodingPlan plan = best_->plan;
    plan.step_m = std::min(coarser * found, coarsest_m);
    MAPCODEC_TRY(try_plan(plan));
  }
  return {};
}

/// Changes all settings of the best plan a little, by chance.
CodingPlan WholeSearch::near_best(std::mt19937_64& random, const Range& steps) const {
  const auto spread = [&](double most) {
    constexpr double kHalf = 9223372036854775808.0;  // of the generator's range
    return std::exp(most * (static_cast<double>(random()) / kHalf - 1));
  };
  CodingPlan plan = best_->plan;
  SurfaceTrade& trade = plan.tiles.trade;
  trade.bit_price *= spread(kPriceSpread);
  trade.forward_weight = std::min(trade.forward_weight * spread(kWeightSpread), 1.0);
  plan.step_m *= spread(kStepSpread) * kAimNear * rms_m_ / best_->sum.rms_m() *
                 step_for_price(trade.bit_price / best_->plan.tiles.trade.bit_price);
  plan.step_m = std::clamp(plan.step_m, steps.finest_m, steps.coarsest_m);
  return plan;
}

Status WholeSearch::try_near(const Range& steps) {
  std::mt19937_64 random(1);
  const bool high = best_->plan.tiles.effort == Effort::high;
  const int broods = high ? kBroodsOfHigh : kBroods, patience = high ? kPatienceOfHigh : kPatience;
  for (int brood = 0, idle = 0; brood < broods && idle < patience; ++brood, ++idle) {
    std::vector<CodingPlan> plans;
    for (std::size_t i = 0; i < kBrood; ++i) plans.push_back(near_best(random, steps));
    std::vector<std::optional<Result<Kept>>> tried(kBrood);
    TbbRunner(arena_).run(kBrood, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) tried[i] = code(plans[i]);
    });
    const double score = best_->score;
    for (auto& t : tried) {
      if (!t->ok()) return t->error();
      look_at(std::move(**t));
    }
    if (best_->score < kClearlyBetter * score) idle = -1;
  }
  return {};
}

Result<std::optional<WholeSearch::Kept>> WholeSearch::run(CodingPlan plan, const Range& steps) {
  best_.reset();
  MAPCODEC_TRY(find_trade(std::move(plan), 1, [&](CodingPlan& trial) {
    trial.step_m = std::clamp(trial.step_m, steps.finest_m, steps.coarsest_m);
    return try_steps(trial, steps);
  }));
  if (best_) MAPCODEC_TRY(try_coarser(steps.coarsest_m));
  if (best_ && best_->plan.tiles.effort != Effort::fast) MAPCODEC_TRY(try_near(steps));
  return std::move(best_);
}

}  // namespace mapcodec
