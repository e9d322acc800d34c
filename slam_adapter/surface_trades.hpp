// SPDX-License-Identifier: GPL-3.0-or-later
// The trades of surfaces that searches try. With noisy surfaces many small cells of rough planes are cheapest
// at an error, with smooth ones few large cells of exact planes; and of the two directions that an RMS
// promise is about only the worse one counts.
#pragma once

#include <functional>

#include "slam_adapter/coding_plan.hpp"

namespace mapcodec {

/// What a plan costs, the less the better, and how its errors in both directions compare.
struct Tried {
  double cost = INFINITY;
  double forward_to_backward = 1;
};
/// Tries a plan, beginning at its step; leaves there the one at which the error is what it should be.
using TryPlan = std::function<Result<Tried>(CodingPlan&)>;

/// By how much the step changes at one error where a bit has to save `times` as much.
[[nodiscard]] double step_for_price(double times);

/// Climbs from the usual trade to the bit price and then to the weight that cost least; a plan with another
/// trade keeps it. Errors: those of `attempt`.
/// @param patience  values in a row that may cost more before the climb ends.
[[nodiscard]] Result<CodingPlan> find_trade(CodingPlan plan, int patience, const TryPlan& attempt);

}  // namespace mapcodec
