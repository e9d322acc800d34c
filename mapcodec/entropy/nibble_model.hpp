// SPDX-License-Identifier: GPL-3.0-or-later
// The adaptive probabilities of one context of a symbol 0..15, as a cumulative distribution that moves
// towards each symbol seen [Fenwick 1994; in this form Giesen 2015]. Integers only (FORMAT.md 4.7). Plain
// loops over sixteen lanes, which compilers turn into a few vector operations.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace mapcodec {

/// Probabilities are in 1/32768.
inline constexpr int kNibbleBits = 15;

namespace nibble {

inline constexpr std::uint32_t kRest = 16;     ///< what a target leaves to each other symbol
inline constexpr std::uint32_t kMemory = 128;  ///< a settled context forgets at this rate

constexpr std::int16_t signed_bound(std::uint64_t v) {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(v));
}
/// Shares of the way to the target in 1/65536: 1/(n + 1.6), at most a half, at least 1/kMemory.
inline constexpr std::array<std::int16_t, kMemory - 1> kStep = [] {
  std::array<std::int16_t, kMemory - 1> t{};
  for (std::uint32_t n = 0; n < t.size(); ++n) {
    const std::uint32_t step = 655360u / (10 * n + 16);
    t[n] = static_cast<std::int16_t>(step > 32767 ? 32767 : step);
  }
  return t;
}();
/// Bounds that a symbol pulls to.
struct alignas(16) Target {
  std::array<std::int16_t, 16> bound;
};
inline constexpr std::array<Target, 16> kTargets = [] {
  std::array<Target, 16> t{};
  for (std::uint32_t s = 0; s < 16; ++s) {
    for (std::uint32_t i = 0; i < 16; ++i)
      t[s].bound[i] = signed_bound(i <= s ? kRest * i : 32768 - kRest * (16 - i));
  }
  return t;
}();

}  // namespace nibble

/// Sixteen parts of 0..32767 as integers of 16 bits: where each starts, and last 32768.
using NibbleBounds = std::array<std::int16_t, 17>;

class alignas(16) NibbleModel {
 public:
  /// All alike.
  constexpr NibbleModel() {
    for (std::size_t i = 0; i < bound_.size(); ++i) bound_[i] = nibble::signed_bound(2048 * i);
  }
  /// Begins with shares of `weights` (at most 16; of others 1/32768) as if `experience` symbols had been
  /// seen.
  constexpr NibbleModel(std::span<const std::uint64_t> weights, std::uint16_t experience)
      : seen_(experience) {
    std::uint64_t sum = 0, before = 0;
    for (const std::uint64_t w : weights) sum += w;
    for (std::size_t i = 0; i < bound_.size(); ++i) {
      bound_[i] = nibble::signed_bound(i + (sum == 0 ? 2047 * i : before * (32768 - 16) / sum));
      before += i < weights.size() ? weights[i] : 0;
    }
    bound_[16] = nibble::signed_bound(32768);
  }

  [[nodiscard]] const NibbleBounds& bounds() const { return bound_; }

  void update(std::uint32_t symbol) {
    const std::int16_t step = nibble::kStep[seen_];
    const nibble::Target target = nibble::kTargets[symbol];
    // Bounds stay apart: no distance falls below the lesser of what it is and what the target has.
    for (std::size_t i = 0; i < 16; ++i) {
      const auto way = static_cast<std::int16_t>(target.bound[i] - bound_[i]);
      bound_[i] = static_cast<std::int16_t>(bound_[i] + static_cast<std::int16_t>((way * step) >> 16));
    }
    seen_ = static_cast<std::uint16_t>(seen_ + (seen_ + 1u < nibble::kStep.size()));
  }

 private:
  NibbleBounds bound_{};
  std::uint16_t seen_ = 0;
};

/// Where the part of a symbol lies.
struct NibblePart {
  std::uint32_t start, size;  ///< in 0..32768; size is never 0
};
[[nodiscard]] inline NibblePart part_of(const NibbleBounds& bounds, std::uint32_t symbol) {
  return {static_cast<std::uint16_t>(bounds[symbol]),
          static_cast<std::uint16_t>(bounds[symbol + 1] - bounds[symbol])};
}

/// The symbol whose part holds `slot` (0..32767).
[[nodiscard]] inline std::uint32_t symbol_at(const NibbleBounds& bounds, std::uint32_t slot) {
  const auto key = static_cast<std::int16_t>(slot);
  std::int16_t below = 0;
  for (std::size_t i = 0; i < 16; ++i) below = static_cast<std::int16_t>(below + (bounds[i] <= key));
  return static_cast<std::uint32_t>(below) - 1;
}

/// Half way between two, rounded up; parts stay larger than 0, since both are.
[[nodiscard]] inline NibbleBounds mean_of(const NibbleBounds& a, const NibbleBounds& b) {
  NibbleBounds mean;
  for (std::size_t i = 0; i < 16; ++i)
    mean[i] = static_cast<std::int16_t>(
        (static_cast<std::uint16_t>(a[i]) + static_cast<std::uint16_t>(b[i]) + 1) >> 1);
  mean[16] = a[16];
  return mean;
}

}  // namespace mapcodec
