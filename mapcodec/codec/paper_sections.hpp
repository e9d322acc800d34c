// SPDX-License-Identifier: GPL-3.0-or-later
// What the two sides of the `paper` codec agree on outside the planes (FORMAT.md 7).
#pragma once

#include <cstdint>

#include "mapcodec/cloud/map_schema.hpp"

namespace mapcodec::paper {

inline constexpr std::uint8_t kFormRaw = 1;    ///< floats as the paper stored them; else entropy-coded
inline constexpr std::uint8_t kFormColor = 2;  ///< triangles and remaining points have a colour
inline constexpr std::size_t kNoColor = ~std::size_t{0};

/// Index in schema.channels of the colour that a `paper` tile keeps, or kNoColor.
[[nodiscard]] inline std::size_t color_channel(const MapSchema& schema) {
  for (std::size_t i = 0; i < schema.channels.size(); ++i) {
    const ChannelSchema& c = schema.channels[i];
    const bool integers = c.info.scalar == ScalarType::u8 || c.info.scalar == ScalarType::u16;
    const bool kept = c.kept == ChannelKept::exact || c.kept == ChannelKept::bounded;
    if (c.info.name == "rgb" && c.info.components == 3 && integers && kept) return i;
  }
  return kNoColor;
}

/// Resampled points can have a colour or a constant, and nothing else.
[[nodiscard]] inline bool can_keep(const MapSchema& schema) {
  const std::size_t color = color_channel(schema);
  for (std::size_t i = 0; i < schema.channels.size(); ++i) {
    const ChannelKept kept = schema.channels[i].kept;
    if (i != color && kept != ChannelKept::dropped && kept != ChannelKept::constant) return false;
  }
  return true;
}

[[nodiscard]] inline std::uint32_t max_color(const ChannelInfo& info) {
  return info.scalar == ScalarType::u8 ? 255 : 65535;
}

}  // namespace mapcodec::paper
