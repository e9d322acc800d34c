// SPDX-License-Identifier: GPL-3.0-or-later
// What the tile encoder and the tile decoder must agree on (FORMAT.md 3).
#pragma once

#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

inline constexpr std::uint8_t kTileFlagOwnStep =
    1;  ///< a float64 voxel side follows, instead of schema.step_m
/// Coded quickly by an update, to be folded later; a decoder need not care.
inline constexpr std::uint8_t kTileFlagPending = 2;

/// Indices of the channels of `schema` that have a section of their own in a tile of this codec: those kept
/// exactly or within a bound. A `paper` or `occupancy` tile carries all inside the geometry section.
[[nodiscard]] inline std::vector<std::size_t> coded_channels(const MapSchema& schema, CodecId codec) {
  std::vector<std::size_t> r;
  if (codec == CodecId::paper || codec == CodecId::occupancy) return r;
  for (std::size_t i = 0; i < schema.channels.size(); ++i) {
    const ChannelKept kept = schema.channels[i].kept;
    if (kept == ChannelKept::exact || kept == ChannelKept::bounded) r.push_back(i);
  }
  return r;
}

/// A payload taken apart; the spans look into it.
struct TileSections {
  TileHeader header;
  double step_m = 0;  ///< the tile's own, else schema.step_m
  ByteSpan geometry;
  std::vector<ByteSpan> channels;  ///< one per coded channel, in schema order
};

/// @param bytes  may be hostile. Errors: Truncated, Malformed, LimitExceeded, UnknownCodec.
[[nodiscard]] Result<TileSections> read_tile_sections(ByteSpan bytes, const MapSchema& schema,
                                                      const DecodeLimits& limits);

/// Of the first bytes of a payload: its geometry section, cut short or not, and no channel. Errors: as above.
[[nodiscard]] Result<TileSections> read_tile_prefix(ByteSpan bytes, const MapSchema& schema,
                                                    const DecodeLimits& limits);

}  // namespace mapcodec
