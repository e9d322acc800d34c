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

/// How a context that has seen `n` bits learns from the next.
struct alignas(8) Adaptation {
  std::uint16_t slow_step, fast_step;  ///< shares of the way to the bit, in 1/65536
  std::uint16_t next;                  ///< its n afterwards
};
/// Slow steps are 65536 / (n + 1.6), those of a running mean that starts with a little doubt, to the n where
/// they are 1/128; fast ones stay from 1/16.
inline constexpr std::array<Adaptation, 127> kAdaptation = [] {
  std::array<Adaptation, 127> t{};
  for (std::uint32_t n = 0; n < t.size(); ++n) {
    const std::uint32_t step = 655360u / (10 * n + 16);
    t[n] = {static_cast<std::uint16_t>(step), static_cast<std::uint16_t>(step < 4096 ? 4096 : step),
            static_cast<std::uint16_t>(n + 1 < t.size() ? n + 1 : n)};
  }
  return t;
}();

/// Mean of two estimators with rates max(1/(n+1.6), 1/16) and max(1/(n+1.6), 1/128): the fast one follows
/// changes, the slow one settles.
class alignas(8) BitModel {
 public:
  BitModel() = default;
  /// Begins at `probability` (of a 1) as if `experience` bits had been seen.
  constexpr BitModel(std::uint16_t probability, std::uint16_t experience)
      : fast_(probability), slow_(probability), mean_(probability), count_(experience) {}

  [[nodiscard]] std::uint32_t probability() const { return mean_; }

  void update(bool bit) { learn(0 - std::uint32_t{bit}); }
  /// The same for a bit given as a mask, all ones or zero.
  void learn(std::uint32_t one) {
    // Targets short of 0 and 65536: no estimate ever passes them, so no probability needs clamping.
    const auto target = static_cast<std::int32_t>(kMargin + (one & (65536 - 2 * kMargin)));
    const Adaptation& step = kAdaptation[count_];
    const std::int32_t fast = fast_ + (((target - fast_) * step.fast_step) >> 16);
    const std::int32_t slow = slow_ + (((target - slow_) * step.slow_step) >> 16);
    fast_ = static_cast<std::uint16_t>(fast);
    slow_ = static_cast<std::uint16_t>(slow);
    mean_ = static_cast<std::uint16_t>(static_cast<std::uint32_t>(fast + slow) >> 1);
    count_ = step.next;
  }

 private:
  static constexpr std::uint32_t kMargin = kMinProbability;
  std::uint16_t fast_ = 32768;
  std::uint16_t slow_ = 32768;
  std::uint16_t mean_ = 32768;  ///< of the two: read more often than written
  std::uint16_t count_ = 0;
};

}  // namespace mapcodec
