// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>

namespace mapcodec {

/// Wall time between laps [s].
class Stopwatch {
 public:
  double lap() {
    const auto now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - from_).count();
    from_ = now;
    return seconds;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point from_ = Clock::now();
};

}  // namespace mapcodec
