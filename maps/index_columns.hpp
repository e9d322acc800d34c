// SPDX-License-Identifier: GPL-3.0-or-later
// What the encoder and the decoder of the index must agree on (FORMAT.md, Index).
#pragma once

#include <cmath>
#include <cstdint>

namespace mapcodec {

inline constexpr std::uint8_t kIndexDelta = 1;   ///< bit of the first byte: changes, not all tiles
inline constexpr std::uint8_t kIndexHashes = 2;  ///< another: the hash of every segment is stored
inline constexpr std::uint8_t kIndexScaleShift =
    4;  ///< its bits 4..7: scale i is the metadata's achieved error

/// Errors are multiples of a power of two near 1/64 of their scale: a coarser grid's values lie on every
/// finer one, so that rewriting an index under another scale does not round up again and again.
struct ErrorGrid {
  double unit = 0;          ///< 0: all errors are 0
  std::uint64_t steps = 0;  ///< that reach the scale; at most 64

  explicit ErrorGrid(double scale) {
    int exponent = 0;
    if (!(scale > 0)) return;
    std::frexp(scale, &exponent);  // scale < 2^exponent
    unit = std::ldexp(1.0, exponent - 6);
    steps = unit > 0 ? static_cast<std::uint64_t>(std::ceil(scale / unit)) : 0;
  }
};

/// Columns that are left out when they are all zero: bits of the field `present`, in the order in which they
/// are stored (codec and points, which are always there, come after z).
enum class IndexColumn : std::uint16_t {
  submap = 1 << 0,
  level = 1 << 1,
  x = 1 << 2,
  y = 1 << 3,
  z = 1 << 4,
  extra_segments = 1 << 5,
  reach = 1 << 6,
  bounds_x = 1 << 7,
  bounds_y = 1 << 8,
  bounds_z = 1 << 9,
  error_0 = 1 << 10,
  error_1 = 1 << 11,
  error_2 = 1 << 12,
  error_3 = 1 << 13,
  gap = 1 << 14,
  dead = 1 << 15,
};
[[nodiscard]] constexpr IndexColumn nth_column(IndexColumn first, std::size_t n) {
  return static_cast<IndexColumn>(static_cast<unsigned>(first) << n);
}

inline constexpr std::uint8_t kFullCube = 0x1E;  ///< bounds are stored XORed with this: a full cube is zero

}  // namespace mapcodec
