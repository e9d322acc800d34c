// SPDX-License-Identifier: GPL-3.0-or-later
// What the tile encoder and the tile decoder must agree on (FORMAT.md 3).
#pragma once

#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

inline constexpr std::uint8_t kTileFlagOwnStep =
    1;  ///< a float64 voxel side follows, instead of schema.step_m

/// Indices of the channels of `schema` that have a section of their own in a tile of this codec: those kept
/// exactly or within a bound. A `paper` tile carries its colour inside the geometry section.
[[nodiscard]] inline std::vector<std::size_t> coded_channels(const MapSchema& schema, CodecId codec) {
  std::vector<std::size_t> r;
  if (codec == CodecId::paper) return r;
  for (std::size_t i = 0; i < schema.channels.size(); ++i) {
    const ChannelKept kept = schema.channels[i].kept;
    if (kept == ChannelKept::exact || kept == ChannelKept::bounded) r.push_back(i);
  }
  return r;
}

}  // namespace mapcodec
