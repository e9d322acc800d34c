// SPDX-License-Identifier: GPL-3.0-or-later
// Red, green, blue as brightness and two differences, all in integers (FORMAT.md 8.5).
#pragma once

#include <algorithm>
#include <array>

#include "mapcodec/cloud/channel.hpp"

namespace mapcodec {

/// R + G + B, R - B, R - 2 G + B, in 1/4096 of an 8-bit level. Orthogonal; their lengths are sqrt 3, sqrt 2,
/// sqrt 6.
using ColorPoint = std::array<std::int64_t, 3>;
inline constexpr int kColorFraction = 12;
/// The lengths in 1/256.
inline constexpr std::array<std::int64_t, 3> kColorLength{443, 362, 627};

/// How a channel's numbers are scaled.
enum class ColorScale : std::uint8_t {
  eight = 0,    ///< 0..255, in u8 or u16
  sixteen = 1,  ///< 0..65535 in u16: 257 times the 8-bit level
};

[[nodiscard]] inline std::array<std::int64_t, 3> load_rgb(const Channel& c, std::size_t i) {
  if (c.info.scalar == ScalarType::u8) return {c.at(i)[0], c.at(i)[1], c.at(i)[2]};
  return {c.get<std::uint16_t>(i, 0), c.get<std::uint16_t>(i, 1), c.get<std::uint16_t>(i, 2)};
}

[[nodiscard]] inline ColorPoint to_color_point(std::array<std::int64_t, 3> rgb, ColorScale scale) {
  for (std::int64_t& v : rgb) {
    v <<= kColorFraction;
    if (scale == ColorScale::sixteen) v = (v + 128) / 257;
  }
  return {rgb[0] + rgb[1] + rgb[2], rgb[0] - rgb[2], rgb[0] - 2 * rgb[1] + rgb[2]};
}

/// Six times a component to a number of the channel's scale; 10923 / 2^16 is a sixth.
[[nodiscard]] inline std::uint16_t color_number(std::int64_t six, ColorScale scale) {
  constexpr int kShift = kColorFraction + 16;
  const std::int64_t times = scale == ColorScale::sixteen ? 257 : 1;
  const std::int64_t v = (six * (10923 * times) + (std::int64_t{1} << (kShift - 1))) >> kShift;
  return static_cast<std::uint16_t>(
      std::clamp<std::int64_t>(v, 0, scale == ColorScale::sixteen ? 65535 : 255));
}

/// Rounded to the nearest number and clamped.
inline void store_rgb(Channel& c, std::size_t i, const ColorPoint& p, ColorScale scale) {
  const std::array<std::int64_t, 3> six{2 * p[0] + 3 * p[1] + p[2], 2 * (p[0] - p[2]),
                                        2 * p[0] - 3 * p[1] + p[2]};
  for (std::size_t d = 0; d < 3; ++d) {
    const std::uint16_t v = color_number(six[d], scale);
    if (c.info.scalar == ScalarType::u8) {
      c.at(i)[d] = static_cast<std::uint8_t>(v);
    } else {
      c.set<std::uint16_t>(i, v, d);
    }
  }
}

}  // namespace mapcodec
