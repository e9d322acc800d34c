// SPDX-License-Identifier: GPL-3.0-or-later
// Finds on a sample how surfaces should trade bits and errors.
#pragma once

#include "slam_adapter/surface_trades.hpp"

namespace mapcodec {

/// What a sample's positions cost and lose by a plan. Errors: those of encoding; Cancelled.
using MeasurePlan = std::function<Result<CodedSum>(const CodingPlan&)>;

class TradeSearch {
 public:
  /// @param rms_m  that all trades are compared at. @param measure  must outlive the search.
  TradeSearch(double rms_m, const MeasurePlan& measure) : rms_m_(rms_m), measure_(measure) {}

  /// `plan` with the trade that takes the fewest bits at the RMS, and about the step that belongs to it.
  /// Where surfaces cost far more than points do, no other trade is tried. Errors: those of `measure`.
  /// @param plan  has surfaces; its step should give about the RMS.
  [[nodiscard]] Result<CodingPlan> run(CodingPlan plan) const;

 private:
  [[nodiscard]] Result<Tried> bits_of(CodingPlan& plan, int tries) const;
  [[nodiscard]] Result<double> bits_of_points() const;

  double rms_m_;
  const MeasurePlan& measure_;
};

}  // namespace mapcodec
