// SPDX-License-Identifier: GPL-3.0-or-later
// The search for one number that all of rate control comes down to.
#pragma once

#include <algorithm>
#include <cmath>

namespace mapcodec {

/// Looks for the step at which a falling or rising value meets its target: secants in logarithms, kept within
/// what is known.
class LogSecant {
 public:
  /// @param slope  first guess of d log(value) / d log(step). @param longest_leap  of log(step): what is far
  /// away is not as the slope here says.
  LogSecant(double target, double slope, double longest_leap = 1.1)
      : target_(std::log(target)), slope_(slope), longest_leap_(longest_leap) {}

  /// @return the next step to try.
  double next(double step, double value) {
    const double x = std::log(step), y = std::log(std::max(value, 1e-300));
    if (has_last_ && std::abs(x - last_x_) > 1e-6) {
      const double slope = (y - last_y_) / (x - last_x_);
      // Noise of the codec can turn a small difference about; what is far from the usual is not believed.
      if (slope * slope_ > 0) slope_ = std::clamp(std::abs(slope), 0.2, 6.0) * (slope_ > 0 ? 1 : -1);
    }
    // The function rises if slope_ > 0: values below the target then bound the step from below.
    ((y < target_) == (slope_ > 0) ? low_ : high_) = x;
    last_x_ = x;
    last_y_ = y;
    has_last_ = true;
    double to = x + std::clamp((target_ - y) / slope_, -longest_leap_, longest_leap_);
    const bool bracketed = std::isfinite(low_) && std::isfinite(high_);
    if (bracketed && (to <= low_ || to >= high_)) to = (low_ + high_) / 2;
    return std::exp(to);
  }
  [[nodiscard]] double slope() const { return slope_; }
  /// Whether the value leaps across the target at one step, as where tiles change their codec.
  [[nodiscard]] bool is_leap() const { return high_ - low_ < 0.02; }

 private:
  double target_, slope_, longest_leap_;
  double last_x_ = 0, last_y_ = 0;
  bool has_last_ = false;
  double low_ = -INFINITY, high_ = INFINITY;
};

}  // namespace mapcodec
