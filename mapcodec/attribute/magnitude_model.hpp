// SPDX-License-Identifier: GPL-3.0-or-later
// One context of a non-negative integer of up to 64 bits: bit length in unary, two bits below the leading one
// in the context of the length, the rest raw. Smaller than IntegerModel, since channels keep hundreds of
// them (FORMAT.md 4.4).
#pragma once

#include <algorithm>
#include <array>
#include <bit>

#include "mapcodec/entropy/bit_model.hpp"

namespace mapcodec {

class MagnitudeModel {
 public:
  template <class Side>
  std::uint64_t code(Side& side, std::uint64_t v) {
    const std::size_t length = code_length(side, static_cast<std::size_t>(std::bit_width(v)));
    if (length < 2) return length;
    const std::size_t modelled = std::min<std::size_t>(length - 1, kModelledBits);
    std::array<BitModel, 4>& tree = mantissa_[std::min(length, kLengths) - 1];
    std::uint64_t r = 1;
    for (std::size_t i = 0; i < modelled; ++i) {
      r = r * 2 + side.bit(((v >> (length - 2 - i)) & 1) != 0, tree[r]);
    }
    const int raw = static_cast<int>(length - 1 - modelled);
    return raw > 0 ? (r << raw) | side.raw(v & ((std::uint64_t{1} << raw) - 1), raw) : r;
  }

 private:
  static constexpr std::size_t kModelledBits = 2;
  static constexpr std::size_t kLengths = 16;  ///< longer numbers share the contexts of this length

  template <class Side>
  std::size_t code_length(Side& side, std::size_t length) {
    std::size_t i = 0;
    while (i < 64 && side.bit(length > i, unary_[std::min(i, kLengths - 1)])) ++i;
    return i;
  }

  std::array<BitModel, kLengths> unary_{};
  std::array<std::array<BitModel, 4>, kLengths> mantissa_{};
};

}  // namespace mapcodec
