// SPDX-License-Identifier: GPL-3.0-or-later
// What both generations of LAZ's point coders share: each item of a point record is predicted from the one
// before.
#pragma once

#include <array>
#include <cstring>
#include <memory>
#include <vector>

#include "slam_adapter/formats/laz_bits.hpp"

namespace mapcodec {

/// Models that come into being when first asked for.
class LazModels {
 public:
  LazModels(std::size_t models, std::uint32_t symbols) : models_(models), symbols_(symbols) {}
  LazSymbols& operator[](std::size_t i) {
    if (!models_[i]) models_[i] = std::make_unique<LazSymbols>(symbols_);
    return *models_[i];
  }

 private:
  std::vector<std::unique_ptr<LazSymbols>> models_;
  std::uint32_t symbols_;
};

/// About the median of the last values, without sorting them: five in order; a new one pushes out the largest
/// or the smallest, by turns as they come to lie.
class LazMedian {
 public:
  [[nodiscard]] std::int32_t get() const { return values_[2]; }
  void add(std::int32_t v);

 private:
  std::array<std::int32_t, 5> values_{};
  bool drop_largest_ = true;
};

/// Red, green and blue of 16 bits.
class LazColor {
 public:
  using Rgb = std::array<std::uint16_t, 3>;
  [[nodiscard]] Rgb next(LazDecoder& from, const Rgb& last);

 private:
  std::uint32_t corrected(LazDecoder& from, std::size_t model, int prediction);

  LazSymbols changed_{128};
  std::array<LazSymbols, 6> models_;
};

/// GPS times as 64-bit integers: multiples of the last difference, in up to four sequences that take turns.
class LazTime {
 public:
  /// @param can_stay  first generation: "the same time again" has a symbol of its own.
  LazTime(bool can_stay, std::uint64_t first);
  [[nodiscard]] std::uint64_t next(LazDecoder& from);

 private:
  /// True if the symbol chose another sequence, whose symbol follows.
  bool step_from_zero(LazDecoder& from);
  bool step(LazDecoder& from);
  void add_multiple(LazDecoder& from, std::int32_t code);
  void whole(LazDecoder& from);

  bool can_stay_;
  LazSymbols from_zero_, multiple_;
  LazIntegers integers_{32, 9};
  std::array<std::uint64_t, 4> times_{};
  std::array<std::int32_t, 4> differences_{};
  std::array<int, 4> extremes_{};
  std::size_t at_ = 0, newest_ = 0;
};

/// k without its lowest bit, at most `most`: the context that the bits of one correction are for the next.
[[nodiscard]] inline std::size_t even_bits(unsigned k, unsigned most) {
  return k < most ? k & ~1u : most;
}

template <class T>
[[nodiscard]] T laz_load(const std::uint8_t* from) {
  T v;
  std::memcpy(&v, from, sizeof(T));
  return v;
}
template <class T>
void laz_store(std::uint8_t* to, T v) {
  std::memcpy(to, &v, sizeof(T));
}

}  // namespace mapcodec
