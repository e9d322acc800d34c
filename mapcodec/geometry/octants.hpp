// SPDX-License-Identifier: GPL-3.0-or-later
// Masks of occupied octants as tables: a plain x86-64 has no instruction that counts bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace mapcodec {

/// Octants in a mask.
inline constexpr std::array<std::uint8_t, 256> kOctantCount = [] {
  std::array<std::uint8_t, 256> t{};
  for (std::size_t m = 1; m < 256; ++m) t[m] = static_cast<std::uint8_t>(t[m >> 1] + (m & 1));
  return t;
}();

/// [mask][i]: which of the mask's octants octant i is, from 1; 0 if it is none.
inline constexpr std::array<std::array<std::uint8_t, 8>, 256> kOctantRank = [] {
  std::array<std::array<std::uint8_t, 8>, 256> t{};
  for (std::size_t m = 0; m < 256; ++m) {
    for (std::size_t i = 0; i < 8; ++i) {
      if ((m >> i & 1) != 0) t[m][i] = static_cast<std::uint8_t>(1 + kOctantCount[m & ((1u << i) - 1)]);
    }
  }
  return t;
}();

}  // namespace mapcodec
