// SPDX-License-Identifier: GPL-3.0-or-later
// Lookup tables of the octree's contexts: eight small numbers, one for each child, packed into the bytes of a
// word.
#pragma once

#include "mapcodec/codec/octree_nodes.hpp"

namespace mapcodec::octree {

/// Which halves of an axis a mask occupies: 0 none, 1 low, 2 high, 3 both.
inline constexpr std::array<std::array<std::uint8_t, 256>, 3> kHalves = [] {
  std::array<std::array<std::uint8_t, 256>, 3> t{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t m = 0; m < 256; ++m) {
      t[axis][m] =
          static_cast<std::uint8_t>(((m & kHalfMask[axis][0]) != 0) + 2 * ((m & kHalfMask[axis][1]) != 0));
    }
  }
  return t;
}();

/// Twice what a lone child sees in the coded neighbour before along an axis: 0 no node, 1 none that touches,
/// 2 one that does.
inline constexpr std::array<std::array<std::uint8_t, 256>, 3> kSingleTouch = [] {
  std::array<std::array<std::uint8_t, 256>, 3> t{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t m = 1; m < 256; ++m) t[axis][m] = (m & kHalfMask[axis][1]) != 0 ? 4 : 2;
  }
  return t;
}();

/// [terms][sum], sum / terms a mean count of 1/4 to 8: its class, the number of limits below it.
inline constexpr std::array<std::array<std::uint8_t, 33>, 5> kCountClass = [] {
  constexpr std::uint32_t kQuarters[] = {4, 5, 6, 8, 12, 20};
  std::array<std::array<std::uint8_t, 33>, 5> t{};
  for (std::uint32_t terms = 1; terms < 5; ++terms) {
    for (std::uint32_t sum = 0; sum <= 32; ++sum) {
      for (const std::uint32_t q : kQuarters) t[terms][sum] += 4 * sum > q * terms;
    }
  }
  return t;
}();

/// What child `i` sees across the faces of its parent along one axis, from the mask of the coded neighbour
/// before (0: none) and whether there is a neighbour after: low children 0 no node, 1 a node, 2 an occupied
/// cell that touches the child; high children 0 or 1, a node after. Times 3^axis.
constexpr std::uint64_t touch_word(std::uint32_t axis, std::uint32_t before, std::uint32_t after) {
  constexpr std::uint64_t kPower[] = {1, 3, 9};
  std::uint64_t word = 0;
  for (std::uint32_t i = 0; i < 8; ++i) {
    const bool high = (i >> axis & 1) != 0;
    const std::uint64_t low_state = before == 0 ? 0 : 1 + (before >> (i | 1u << axis) & 1);
    word |= (high ? after : low_state) * kPower[axis] << (8 * i);
  }
  return word;
}
/// [axis][after][before]
inline constexpr std::array<std::array<std::array<std::uint64_t, 256>, 2>, 3> kTouch = [] {
  std::array<std::array<std::array<std::uint64_t, 256>, 2>, 3> t{};
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    for (std::uint32_t after = 0; after < 2; ++after) {
      for (std::uint32_t before = 0; before < 256; ++before)
        t[axis][after][before] = touch_word(axis, before, after);
    }
  }
  return t;
}();

/// [slab states of x, y, z in 2 bits each]: per child, bit a says whether the slab of axis a was last
/// occupied in the child's half.
inline constexpr std::array<std::uint64_t, 64> kSlabWord = [] {
  std::array<std::uint64_t, 64> t{};
  for (std::uint32_t states = 0; states < 64; ++states) {
    for (std::uint32_t i = 0; i < 8; ++i) {
      std::uint64_t bits = 0;
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        bits |= std::uint64_t{states >> (2 * axis) >> (i >> axis & 1) & 1} << axis;
      }
      t[states] |= bits << (8 * i);
    }
  }
  return t;
}();

}  // namespace mapcodec::octree
