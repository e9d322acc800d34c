// SPDX-License-Identifier: GPL-3.0-or-later
// What is asked of a map against what codings of the whole map gave.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "slam_adapter/log_secant.hpp"
#include "slam_adapter/plan_choice.hpp"

namespace mapcodec {

/// Changes the plan from one coding to the next until the map keeps what is asked: first the positions, then
/// the colours where they lie.
class PlanAdjuster {
 public:
  /// All must outlive it; the plan of `choice` and what `schema` promises are changed.
  /// @param position_step_m  what the positions' promise alone would allow.
  PlanAdjuster(const CompressOptions& options, MapSchema& schema, PlanChoice& choice, double position_step_m);

  /// @param coded  the whole map, by the plan as it is. @return false: it is to be coded once more, by the
  /// plan as it is now.
  [[nodiscard]] bool is_kept_or_adjust(const CodedSum& coded);

  /// Colours of surface tiles are coded to a slope of the whole map.
  [[nodiscard]] bool has_color_slope() const;
  /// Only where the positions lie shows what colours cost there.
  [[nodiscard]] bool wants_positions_alone() const { return has_color_slope() && !positions_found_; }
  /// Of surface tiles, the same for all; 0: each meets the bound.
  [[nodiscard]] double color_slope() const { return color_slope_; }
  /// Share of the colour bound that tiles aim at.
  [[nodiscard]] double color_target() const { return color_target_; }

  /// In one line each, once all is kept.
  void say_what_color_cost(std::vector<std::string>& warnings) const;
  /// A bound that nobody asked for is not promised if it was not kept.
  void record_reachable_color();

 private:
  enum class ColorState { met, missed, finer_positions };
  [[nodiscard]] bool meets_target_or_adjust();
  [[nodiscard]] bool meets_rms_or_adjust();
  [[nodiscard]] bool meets_color_or_adjust();
  [[nodiscard]] ColorState adjust_map_color(double asked_bound);
  void say_if_finer_for_color(std::vector<std::string>& warnings) const;
  void say_if_color_misses(std::vector<std::string>& warnings) const;

  const CompressOptions& options_;
  MapSchema& schema_;
  PlanChoice& choice_;
  CodedSum coded_;
  double position_step_;
  double searched_step_;                         // where the search ended on the whole map; 0: it did not
  double best_step_ = 0, best_bits_ = INFINITY;  // of the codings that kept the promise, the smallest
  std::optional<LogSecant> secant_;              // over the codings of the whole map
  int target_tries_ = 0, rms_tries_ = 0, color_tries_ = 0;
  std::optional<LogSecant> color_secant_;
  double color_slope_ = 0;
  bool positions_found_ = false;  // until then colours are not coded where they follow a slope
  double color_target_ = 1;
};

}  // namespace mapcodec
