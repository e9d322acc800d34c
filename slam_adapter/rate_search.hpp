// SPDX-License-Identifier: GPL-3.0-or-later
// Finds the one step of a map that meets a promise or a size, on a sample of its tiles.
#pragma once

#include <optional>

#include "slam_adapter/mixture_search.hpp"
#include "slam_adapter/tile_sample.hpp"

namespace mapcodec {

/// Tries plans on a sample and remembers what they gave.
class RateSearch {
 public:
  /// All must outlive the search. @param schema  its channels count for sizes, not for errors.
  /// @param large  of take_large_sample; not looked at where `sample` is the whole map.
  RateSearch(const TileSample& sample, const TileSample& large, const MapSchema& schema, Arena& arena,
             const std::atomic<bool>* stop)
      : sample_(sample), large_(large), schema_(schema), arena_(arena), stop_(stop) {}

  /// The step with which the sample's RMS is a little below `rms_m`, within about 1 %. Where even coarse
  /// steps lose less (all points equal, say), a coarse one. Where the sample is the whole map, mostly one
  /// that was tried and keeps the promise closely (see coded()). Errors: those of encoding; Cancelled.
  [[nodiscard]] Result<CodingPlan> for_rms(CodingPlan plan, double rms_m);
  /// Where the sample is the whole map: a coding for each piece, by surfaces or, if `with_points`, as points.
  /// Nothing if none of those tried keep the RMS together, or all are points. Errors: as for_rms.
  /// @param plan  out: its trade and step.
  [[nodiscard]] Result<std::optional<std::vector<TileTry>>> for_each_tile(CodingPlan& plan, double rms_m,
                                                                          bool with_points);
  /// The step with which the sample takes about `bits_per_point`, channels included. Errors: InvalidArgument
  /// where no step does, because channels alone take more; those of encoding; Cancelled.
  [[nodiscard]] Result<CodingPlan> for_bits(CodingPlan plan, double bits_per_point);
  /// Positions alone.
  [[nodiscard]] Result<CodedSum> measure(const CodingPlan& plan) const;

  /// The whole map's positions as coded at the found plan's step, if it was tried; its errors are exact.
  [[nodiscard]] const std::optional<CodedTiles>& coded() const { return coded_; }
  /// What the last search measured last, at a step near that of its plan.
  [[nodiscard]] const CodedSum& found() const { return found_; }
  /// Whether its value leaps across the target, so that the plan is on one side of it.
  [[nodiscard]] bool leapt() const { return leapt_; }
  /// No tile of any try took points.
  [[nodiscard]] bool surfaces_alone() const { return surfaces_alone_; }
  /// Bits per point for positions that it expects of its plan.
  [[nodiscard]] double expected_bits() const { return expected_bits_; }
  /// By how much the logarithm of the RMS grows with that of the step, near the last search's end.
  [[nodiscard]] double rms_slope() const { return rms_slope_; }
  /// By how much the logarithm of the size falls.
  [[nodiscard]] double bits_slope() const { return bits_slope_; }

 private:
  const TileSample &sample_, &large_;
  const MapSchema& schema_;
  Arena& arena_;
  const std::atomic<bool>* stop_;
  using Value = double (CodedSum::*)() const;
  struct Range {
    double finest, coarsest;
  };
  [[nodiscard]] double first_step(const CodingPlan& plan, double rms_m) const;
  [[nodiscard]] Range steps_for(double rms_m) const;
  [[nodiscard]] Status seek_rms(CodingPlan& plan, const MapSchema& schema, double rms_m, const Range& steps);
  [[nodiscard]] Status seek_whole(CodingPlan& plan, const MapSchema& schema, double rms_m, const Range& steps,
                                  double& slope);
  [[nodiscard]] Status choose_trade(CodingPlan& plan, const MapSchema& schema, double rms_m,
                                    const Range& steps) const;
  [[nodiscard]] Status seek_on(const TileSample& sample, CodingPlan& plan, const MapSchema& schema,
                               Value value, double target, const Range& steps, double& slope);

  CodedSum found_;
  std::optional<CodedTiles> coded_;
  bool leapt_ = false, surfaces_alone_ = true;
  double expected_bits_ = 0;
  double rms_slope_ = 1, bits_slope_ = 1;
};

/// The largest voxel side <= step_m on which colour `channel` (an index into schema.channels, bounded) can
/// keep its bound with `points`: coarser voxels hold points of too different colours at one position. Errors:
/// those of encoding.
[[nodiscard]] Result<double> find_step_for_color(std::size_t channel, double step_m, const TileSample& sample,
                                                 const MapSchema& schema, Arena& arena);

}  // namespace mapcodec
