// SPDX-License-Identifier: GPL-3.0-or-later
// What a lossless tile says about its points beside their cells and plain bits (FORMAT.md 5.2, 5.4).
#pragma once

#include <bit>

#include "mapcodec/attribute/magnitude_model.hpp"
#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// Adaptive models of repeated points and of numbers close to zero.
struct RestModels {
  std::array<BitModel, 2> repeat{};  ///< in the context of the last one
  std::size_t repeated = 0;
  std::array<MagnitudeModel, 3> depth{};

  template <class Side>
  bool code_repeat(Side& side, bool v) {
    const bool r = side.bit(v, repeat[repeated]);
    repeated = r;
    return r;
  }
};

/// Points with a coordinate that is not finite: "as the last", or 24 bytes, each in the context of its place.
class OddPoints {
 public:
  template <class Side>
  Vec3 code(Side& side, const Vec3& p) {
    if (side.bit(same(p, last_), repeat_)) return last_;
    for (std::size_t d = 0; d < 3; ++d) last_[d] = code_number(side, p[d], d);
    return last_;
  }

 private:
  static bool same(const Vec3& a, const Vec3& b) {
    return std::bit_cast<std::array<std::uint64_t, 3>>(a) == std::bit_cast<std::array<std::uint64_t, 3>>(b);
  }
  template <class Side>
  double code_number(Side& side, double x, std::size_t axis) {
    const auto bits = std::bit_cast<std::uint64_t>(x);
    std::uint64_t r = 0;
    for (std::size_t b = 0; b < 8; ++b) {
      std::size_t node = 1;
      for (int i = 7; i >= 0; --i) {
        node = node * 2 + side.bit(((bits >> (56 - 8 * b + static_cast<std::size_t>(i))) & 1) != 0,
                                   bytes_[axis * 8 + b][node]);
      }
      r = (r << 8) | (node & 255);
    }
    return std::bit_cast<double>(r);
  }

  Vec3 last_{0, 0, 0};
  BitModel repeat_;
  std::array<std::array<BitModel, 256>, 24> bytes_{};
};

}  // namespace mapcodec
