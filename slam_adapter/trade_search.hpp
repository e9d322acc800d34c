// SPDX-License-Identifier: GPL-3.0-or-later
// Finds on a sample how surfaces should trade bits and errors.
#pragma once

#include "slam_adapter/surface_trades.hpp"
#include "slam_adapter/tile_sample.hpp"

namespace mapcodec {

class TradeSearch {
 public:
  /// All must outlive the search. @param schema  positions alone. @param rms_m  that all prices are compared
  /// at.
  TradeSearch(const TileSample& sample, const MapSchema& schema, Arena& arena, const std::atomic<bool>* stop,
              double rms_m)
      : sample_(sample), schema_(schema), arena_(arena), stop_(stop), rms_m_(rms_m) {}

  /// `plan` with the trade that takes the fewest bits at the RMS, and about the step that belongs to it.
  /// @param plan  has surfaces; its step should give about the RMS. Errors: those of encoding; Cancelled.
  [[nodiscard]] Result<CodingPlan> run(CodingPlan plan) const;

 private:
  [[nodiscard]] Result<Tried> bits_of(CodingPlan& plan) const;

  const TileSample& sample_;
  const MapSchema& schema_;
  Arena& arena_;
  const std::atomic<bool>* stop_;
  double rms_m_;
};

}  // namespace mapcodec
