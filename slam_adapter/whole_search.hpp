// SPDX-License-Identifier: GPL-3.0-or-later
// The search on a map so small that it is one tile and its own sample: every try is a coding of the map, and
// the best that keeps the promise is the map's.
#pragma once

#include <optional>
#include <random>

#include "slam_adapter/surface_trades.hpp"
#include "slam_adapter/tile_sample.hpp"

namespace mapcodec {

class WholeSearch {
 public:
  /// All must outlive the search. @param schema  positions alone. @param rms_m  the promise.
  /// @param rms_slope  of the logarithm of the RMS with that of the step, to begin with.
  WholeSearch(const TileSample& sample, const MapSchema& schema, Arena& arena, const std::atomic<bool>* stop,
              double rms_m, double rms_slope)
      : sample_(sample), schema_(schema), arena_(arena), stop_(stop), rms_m_(rms_m), slope_(rms_slope) {}

  struct Kept {
    CodingPlan plan;
    CodedSum sum;
    CodedTiles coded;
    double score = INFINITY;  ///< of size and density; the least is the best
  };
  struct Range {
    double finest_m, coarsest_m;  ///< steps
  };
  /// The best of all tries; none if no step keeps the promise. Errors: those of encoding; Cancelled.
  [[nodiscard]] Result<std::optional<Kept>> run(CodingPlan plan, const Range& steps);

  [[nodiscard]] double rms_slope() const { return slope_; }
  /// Whether the RMS leapt across the promise with the last trade.
  [[nodiscard]] bool leapt() const { return leapt_; }
  /// No tile of any try took points.
  [[nodiscard]] bool surfaces_alone() const { return surfaces_alone_; }

 private:
  [[nodiscard]] double score_of(const CodedSum& sum) const;
  [[nodiscard]] Result<Kept> code(const CodingPlan& plan) const;
  void look_at(Kept&& tried);
  [[nodiscard]] Status try_plan(const CodingPlan& plan);
  [[nodiscard]] Result<Tried> try_steps(CodingPlan& plan, const Range& steps);
  [[nodiscard]] Status try_coarser(double coarsest_m);
  [[nodiscard]] CodingPlan near_best(std::mt19937_64& random, const Range& steps) const;
  [[nodiscard]] Status try_near(const Range& steps);

  const TileSample& sample_;
  const MapSchema& schema_;
  Arena& arena_;
  const std::atomic<bool>* stop_;
  double rms_m_, slope_;
  CodedSum last_;
  bool leapt_ = false, surfaces_alone_ = true, first_ = true;
  std::optional<Kept> best_;
};

}  // namespace mapcodec
