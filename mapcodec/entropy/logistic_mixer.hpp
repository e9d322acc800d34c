// SPDX-License-Identifier: GPL-3.0-or-later
// Several probabilities of one bit become one: a weighted sum in the logistic domain, weights learnt online
// [Mahoney 2005, PAQ]. Integers only (FORMAT.md 4.5).
#pragma once

#include <cstddef>

#include "mapcodec/entropy/bit_model.hpp"

namespace mapcodec {

namespace logistic {

/// Logits are fixed point with 8 fractional bits, within +-kMaxLogit.
inline constexpr std::int32_t kMaxLogit = 2047;

constexpr double exponential(double x) {  // Taylor after halving; |x| <= 8
  double term = 1, sum = 1;
  for (int i = 1; i < 24; ++i) {
    term *= x / 256 / i;
    sum += term;
  }
  for (int i = 0; i < 8; ++i) sum *= sum;
  return sum;
}
constexpr double logarithm(double x) {  // x in (0, 1e4): ln via 2 artanh((m - 1) / (m + 1)), m in [0.75, 1.5)
  int twos = 0;
  for (; x >= 1.5; ++twos) x /= 2;
  for (; x < 0.75; --twos) x *= 2;
  const double u = (x - 1) / (x + 1);
  double term = u, sum = 0;
  for (int i = 1; i < 40; i += 2) {
    sum += term / i;
    term *= u * u;
  }
  return 2 * sum + twos * 0.693147180559945309417;
}

/// Logit of probability (i + 1/2) / 4096, rounded to nearest.
inline constexpr std::array<std::int16_t, 4096> kStretch = [] {
  std::array<std::int16_t, 4096> t{};
  for (int i = 0; i < 4096; ++i) {
    const double v = 256 * logarithm((i + 0.5) / (4095.5 - i));
    const double rounded =
        v < 0 ? -static_cast<double>(static_cast<int>(0.5 - v)) : static_cast<int>(v + 0.5);
    const double top = kMaxLogit;
    t[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>(rounded < -top ? -top : (rounded > top ? top : rounded));
  }
  return t;
}();

/// 65536 / (1 + e^(-x)) for x = (i - 2048) / 256, rounded to nearest and kept within BitModel's bounds.
inline constexpr std::array<std::uint16_t, 4096> kSquash = [] {
  std::array<std::uint16_t, 4096> t{};
  for (int i = 0; i < 4096; ++i) {
    const double v = 65536 / (1 + exponential((2048 - i) / 256.0)) + 0.5;
    const auto p = static_cast<std::uint32_t>(v);
    const std::uint32_t top = 65536 - kMinProbability;
    t[static_cast<std::size_t>(i)] =
        static_cast<std::uint16_t>(p < kMinProbability ? kMinProbability : (p > top ? top : p));
  }
  return t;
}();

}  // namespace logistic

/// Weights of the inputs, 1.0 = 65536. One mixer per small context that says which input to trust.
/// @tparam kRateShift  16: weights learn 2^-8 per (probability x logit); less: faster.
template <std::size_t kInputs, int kRateShift = 16>
class LogisticMixerOf {
 public:
  /// Logits of the inputs and the mixed probability; kept between predict and update.
  struct Mixed {
    std::array<std::int32_t, kInputs> logit;
    std::uint32_t probability;
  };

  template <class... Models>
  [[nodiscard]] Mixed predict(const Models&... inputs) const {
    static_assert(sizeof...(Models) == kInputs);
    Mixed m{{stretch(inputs)...}, 0};
    std::int64_t dot = 0;
    for (std::size_t i = 0; i < kInputs; ++i) dot += std::int64_t{weight_[i]} * m.logit[i];
    std::int64_t logit = dot >> 16;
    if (logit > logistic::kMaxLogit) logit = logistic::kMaxLogit;
    if (logit < -logistic::kMaxLogit) logit = -logistic::kMaxLogit;
    m.probability = logistic::kSquash[static_cast<std::size_t>(logit + 2048)];
    return m;
  }

  void update(const Mixed& m, bool bit) {
    const std::int32_t error = (bit ? 65535 : 0) - static_cast<std::int32_t>(m.probability);
    for (std::size_t i = 0; i < kInputs; ++i) {
      const std::int32_t w = weight_[i] + ((m.logit[i] * error + kHalf) >> kRateShift);
      weight_[i] = w > kMaxWeight ? kMaxWeight : (w < -kMaxWeight ? -kMaxWeight : w);
    }
  }

 private:
  static constexpr std::int32_t kHalf = 1 << (kRateShift - 1);
  static constexpr std::int32_t kMaxWeight = 8 << 16;

  static std::int32_t stretch(const BitModel& m) { return logistic::kStretch[m.probability() >> 4]; }

  std::array<std::int32_t, kInputs> weight_ = [] {
    std::array<std::int32_t, kInputs> w;
    w.fill(19661);  // 0.3
    w[0] = 26214;   // 0.4
    return w;
  }();
};
using LogisticMixer = LogisticMixerOf<3>;

/// Codes a bit with the mixture of several contexts and teaches all, unless the side only counts.
/// @param side   writes `known`, or reads the bit (then `known` is not looked at).
template <class Side, class Mixer, class... Models>
[[gnu::always_inline]] inline bool code_mixed(Side& side, bool known, Mixer& mixer, Models&... inputs) {
  const auto mixed = mixer.predict(inputs...);
  const bool bit = side.bit(known, mixed.probability);
  if constexpr (!requires { Side::kOnlyCounts; }) {
    mixer.update(mixed, bit);
    (inputs.update(bit), ...);
  }
  return bit;
}

}  // namespace mapcodec
