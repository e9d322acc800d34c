// SPDX-License-Identifier: GPL-3.0-or-later
// Morton (Z-order) keys of 63 bits: 21 bits an axis, x in bit 0, y in bit 1, z in bit 2 of every triple.
#pragma once

#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

inline constexpr std::uint32_t kMortonBits = 21;  ///< per axis

/// Moves bit i of `v` (21 bits) to bit 3 i.
[[nodiscard]] constexpr std::uint64_t spread_bits(std::uint32_t v) {
  std::uint64_t k = v & 0x1fffffu;
  k = (k | (k << 32)) & 0x001f00000000ffffu;
  k = (k | (k << 16)) & 0x001f0000ff0000ffu;
  k = (k | (k << 8)) & 0x100f00f00f00f00fu;
  k = (k | (k << 4)) & 0x10c30c30c30c30c3u;
  k = (k | (k << 2)) & 0x1249249249249249u;
  return k;
}
/// Undoes spread_bits; the other bits of `k` are ignored.
[[nodiscard]] constexpr std::uint32_t gather_bits(std::uint64_t k) {
  k &= 0x1249249249249249u;
  k = (k | (k >> 2)) & 0x10c30c30c30c30c3u;
  k = (k | (k >> 4)) & 0x100f00f00f00f00fu;
  k = (k | (k >> 8)) & 0x001f0000ff0000ffu;
  k = (k | (k >> 16)) & 0x001f00000000ffffu;
  k = (k | (k >> 32)) & 0x1fffffu;
  return static_cast<std::uint32_t>(k);
}

/// Each coordinate below 2^21.
[[nodiscard]] constexpr std::uint64_t morton_encode(const VoxelCoord& v) {
  return spread_bits(v[0]) | (spread_bits(v[1]) << 1) | (spread_bits(v[2]) << 2);
}
[[nodiscard]] constexpr VoxelCoord morton_decode(std::uint64_t key) {
  return {gather_bits(key), gather_bits(key >> 1), gather_bits(key >> 2)};
}

}  // namespace mapcodec
