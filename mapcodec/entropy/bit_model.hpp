// SPDX-License-Identifier: GPL-3.0-or-later
// The adaptive probability of one binary context. Integers only, so that encoder and decoder agree on any
// machine (FORMAT.md 4.2).
#pragma once

#include <array>
#include <cstdint>

namespace mapcodec {

/// Probabilities are of the bit being 1, in 1/65536; models keep them within [kMinProbability, 65536 -
/// kMinProbability].
inline constexpr std::uint32_t kMinProbability = 32;

/// 65536 / (n + 1.6) for n = 0..: the step of a running mean that starts with a little doubt.
inline constexpr std::array<std::uint16_t, 128> kAdaptationStep = [] {
  std::array<std::uint16_t, 128> t{};
  for (std::uint32_t n = 0; n < 128; ++n) t[n] = static_cast<std::uint16_t>(655360u / (10 * n + 16));
  return t;
}();

/// Mean of two estimators with rates max(1/(n+1.6), 1/16) and max(1/(n+1.6), 1/128): the fast one follows
/// changes, the slow one settles.
class BitModel {
 public:
  [[nodiscard]] std::uint32_t probability() const { return (std::uint32_t{fast_} + slow_) >> 1; }

  void update(bool bit) {
    // Targets short of 0 and 65536: no estimate ever passes them, so no probability needs clamping.
    const std::int32_t target = bit ? 65536 - kMargin : kMargin;
    const std::int32_t slow_step = kAdaptationStep[count_];
    const std::int32_t fast_step = slow_step < 4096 ? 4096 : slow_step;
    fast_ = static_cast<std::uint16_t>(fast_ + (((target - fast_) * fast_step) >> 16));
    slow_ = static_cast<std::uint16_t>(slow_ + (((target - slow_) * slow_step) >> 16));
    count_ = static_cast<std::uint16_t>(count_ + (count_ < kLimit));
  }

 private:
  static constexpr std::int32_t kMargin = kMinProbability;
  static constexpr std::uint16_t kLimit = 126;  // 1/(126+1.6) = 1/128
  std::uint16_t fast_ = 32768;
  std::uint16_t slow_ = 32768;
  std::uint16_t count_ = 0;
};

}  // namespace mapcodec
