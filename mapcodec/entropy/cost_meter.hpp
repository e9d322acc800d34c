// SPDX-License-Identifier: GPL-3.0-or-later
// What symbols would cost, without writing them. For encoders: the doubles in it decide no bit of a decoder.
#pragma once

#include <array>
#include <cmath>

#include "mapcodec/entropy/bit_model.hpp"

namespace mapcodec {

/// A "side" of the code that only counts [bits]. Models stay as they are.
class CostMeter {
 public:
  static constexpr bool kOnlyCounts = true;
  bool bit(bool v, const BitModel& m) { return bit(v, m.probability()); }
  bool bit(bool v, std::uint32_t one) {
    const std::uint32_t p = v ? one : 65536 - one;
    bits_ += kCost[p >> 6];
    return v;
  }
  std::uint64_t raw(std::uint64_t v, int count) {
    bits_ += count;
    return v;
  }
  [[nodiscard]] double bits() const { return bits_; }

 private:
  inline static const std::array<float, 1025> kCost = [] {
    std::array<float, 1025> t{};
    for (std::size_t i = 0; i < t.size(); ++i)
      t[i] = static_cast<float>(-std::log2((double(i) + 0.5) / 1024.5));
    return t;
  }();
  double bits_ = 0;
};

}  // namespace mapcodec
