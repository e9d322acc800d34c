// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/trade_search.hpp"

#include <optional>
#include <utility>

#include "slam_adapter/log_secant.hpp"

namespace mapcodec {
namespace {

constexpr int kFirstTries = 6, kTries = 3, kPatience = 2;
constexpr double kCloseEnough = 0.02;  // of the RMS; the rest is extrapolated
// By how much the logarithm of the size falls with that of the RMS: usually, and at least and at most.
constexpr double kBitsPerRms = 1.3, kLeastSlope = 0.8, kMostSlope = 4;
constexpr double kRmsPerStep = 0.6;   // by how much that of the RMS grows with that of the step
constexpr double kClearlyDear = 1.6;  // times the bits of points: no trade makes up for it
constexpr double kVoxelPerRms = 2;    // a cell's centre loses half its side

}  // namespace

/// Bits per point at the RMS, about; `plan` has the step for it then.
Result<Tried> TradeSearch::bits_of(CodingPlan& plan, int tries) const {
  LogSecant secant(rms_m_, kRmsPerStep);
  double bits = 0, off = 0, slope = kBitsPerRms;
  Tried r;
  for (int i = 0; i < tries; ++i) {
    MAPCODEC_ASSIGN(const CodedSum sum, measure_(plan));
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

Result<double> TradeSearch::bits_of_points() const {
  CodingPlan points;
  points.step_m = kVoxelPerRms * rms_m_;
  MAPCODEC_ASSIGN(const CodedSum sum, measure_(points));
  return sum.geometry_bits_per_point();
}

Result<CodingPlan> TradeSearch::run(CodingPlan plan) const {
  CodingPlan trial = plan;
  trial.tiles.rough_errors = true;
  // Of surfaces alone: tiles that change over to points and back would hide what a trade does.
  trial.choice = CodecChoice::surface;
  MAPCODEC_ASSIGN(std::optional<Tried> first, bits_of(trial, kFirstTries));
  MAPCODEC_ASSIGN(const double points, bits_of_points());
  if (first->cost < kClearlyDear * points) {
    const TryPlan attempt = [&](CodingPlan& t) {
      return first ? Result<Tried>(*std::exchange(first, std::nullopt)) : bits_of(t, kTries);
    };
    MAPCODEC_ASSIGN(trial, find_trade(std::move(trial), kPatience, attempt));
  }
  plan.tiles.trade = trial.tiles.trade;
  plan.step_m = trial.step_m;
  return plan;
}

}  // namespace mapcodec
