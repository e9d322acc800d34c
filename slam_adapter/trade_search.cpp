// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/trade_search.hpp"

#include "slam_adapter/log_secant.hpp"

namespace mapcodec {
namespace {

constexpr int kTries = 3, kPatience = 2;
constexpr double kCloseEnough = 0.02;  // of the RMS; the rest is extrapolated
// By how much the logarithm of the size falls with that of the RMS: usually, and at least and at most.
constexpr double kBitsPerRms = 1.3, kLeastSlope = 0.8, kMostSlope = 4;
constexpr double kRmsPerStep = 0.6;  // by how much that of the RMS grows with that of the step

}  // namespace

/// Bits per point at the RMS, about; `plan` has the step for it then.
Result<Tried> TradeSearch::bits_of(CodingPlan& plan) const {
  LogSecant secant(rms_m_, kRmsPerStep);
  double bits = 0, off = 0, slope = kBitsPerRms;
  Tried r;
  for (int i = 0; i < kTries; ++i) {
    MapSchema with_step = schema_;
    with_step.step_m = plan.step_m;
    MAPCODEC_ASSIGN(const CodedSum sum, encode_sample(sample_, with_step, plan, arena_, stop_));
    const double last_off = off, last_bits = bits;
    off = sum.rms_m() / rms_m_;
    bits = sum.geometry_bits_per_point();
    if (i > 0 && std::abs(off / last_off - 1) > kCloseEnough)
      slope = std::clamp(-std::log(bits / last_bits) / std::log(off / last_off), kLeastSlope, kMostSlope);
    r = {bits * std::pow(off, slope), sum.forward_to_backward()};
    plan.step_m = secant.next(plan.step_m, sum.rms_m());
    if (std::abs(off - 1) < kCloseEnough) break;
  }
  return r;
}

Result<CodingPlan> TradeSearch::run(CodingPlan plan) const {
  const bool rough = plan.tiles.rough_errors;
  plan.tiles.rough_errors = true;
  MAPCODEC_ASSIGN(plan,
                  find_trade(std::move(plan), kPatience, [&](CodingPlan& trial) { return bits_of(trial); }));
  plan.tiles.rough_errors = rough;
  return plan;
}

}  // namespace mapcodec
