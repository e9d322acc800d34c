// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/whole_search.hpp"

#include "slam_adapter/log_secant.hpp"
#include "slam_adapter/surface_trades.hpp"

namespace mapcodec {
namespace {

// The first trade tells the slope; of others it shows soon whether they are better.
constexpr int kTries = 6, kTriesOfOthers = 2, kTriesForNear = 3;
constexpr double kAim = 0.992, kNear = 0.98, kLeast = 0.95, kSpent = 0.997;  // of the promise
// Where the promise is not spent, coarser steps are tried: errors do not grow evenly with them.
constexpr double kCoarser[] = {1.01, 1.02, 1.04, 1.07};
// Surfaces of few large cells are small, but lose where the points were. Beyond what is hardly seen, a
// hundredth of density error has to save so many hundredths of a bit per point.
constexpr double kHardlySeen = 0.1, kDensityWorth = 0.5;

double score_of(const CodedSum& sum) {
  return sum.geometry_bits_per_point() +
         kDensityWorth * std::max(0.0, sum.errors().density_error - kHardlySeen);
}

}  // namespace

Status WholeSearch::try_plan(const CodingPlan& plan) {
  MapSchema with_step = schema_;
  with_step.step_m = plan.step_m;
  CodedTiles coded;
  MAPCODEC_ASSIGN(last_, encode_sample(sample_, with_step, plan, arena_, stop_, &coded));
  surfaces_alone_ = surfaces_alone_ && last_.surface_share() == 1;
  if (last_.rms_m() > rms_m_) return {};
  const double score = score_of(last_);
  if (!best_ || score < best_->score) best_ = Kept{plan, last_, std::move(coded), score};
  return {};
}

/// @param plan  its step is where to begin, and then the one that keeps the promise, if any was found.
Result<Tried> WholeSearch::try_steps(CodingPlan& plan, double finest, double coarsest) {
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
    const double next = std::clamp(secant.next(trial.step_m, last_.rms_m()), finest, coarsest);
    slope_ = secant.slope();
    leapt_ = secant.is_leap();
    if (leapt_ || next == trial.step_m) break;
    trial.step_m = next;
  }
  return least;
}

Status WholeSearch::try_coarser(double coarsest) {
  const double found = best_->plan.step_m;
  for (const double coarser : kCoarser) {
    if (best_->sum.rms_m() >= kSpent * rms_m_) break;
    CodingPlan plan = best_->plan;
    plan.step_m = std::min(coarser * found, coarsest);
    MAPCODEC_TRY(try_plan(plan));
  }
  return {};
}

Result<std::optional<WholeSearch::Kept>> WholeSearch::run(CodingPlan plan, double finest, double coarsest) {
  best_.reset();
  MAPCODEC_TRY(find_trade(std::move(plan), 1, [&](CodingPlan& trial) {
    trial.step_m = std::clamp(trial.step_m, finest, coarsest);
    return try_steps(trial, finest, coarsest);
  }));
  if (best_) MAPCODEC_TRY(try_coarser(coarsest));
  return std::move(best_);
}

}  // namespace mapcodec
