// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/tile_sections.hpp"

#include <string>

#include "mapcodec/base/byte_reader.hpp"

namespace mapcodec {
namespace {

Result<TileHeader> read_header(ByteReader& in, std::uint8_t& flags) {
  TileHeader h;
  h.codec = static_cast<CodecId>(in.u8());
  flags = in.u8();
  h.points = in.varint();
  MAPCODEC_TRY(in.status("tile header"));
  if (h.codec < CodecId::lossless || h.codec > CodecId::occupancy) {
    return make_error(ErrorCode::kUnknownCodec,
                      "tile codec " + std::to_string(int(h.codec)) + " is not known here", 0);
  }
  if ((flags & ~(kTileFlagOwnStep | kTileFlagPending)) != 0)
    return make_error(ErrorCode::kMalformed, "tile header has unknown flags", 1);
  return h;
}

/// All before the sections.
Result<TileSections> read_start(ByteReader& in, const MapSchema& schema, const DecodeLimits& limits) {
  TileSections s;
  std::uint8_t flags = 0;
  MAPCODEC_ASSIGN(s.header, read_header(in, flags));
  if (s.header.points > limits.max_points) {
    return make_error(ErrorCode::kLimitExceeded,
                      "tile announces " + std::to_string(s.header.points) + " points", 2);
  }
  s.step_m = (flags & kTileFlagOwnStep) != 0 ? in.f64() : schema.step_m;
  MAPCODEC_TRY(in.status("tile header"));
  return s;
}

}  // namespace

Result<TileHeader> read_tile_header(ByteSpan bytes) {
  ByteReader in(bytes);
  std::uint8_t flags = 0;
  return read_header(in, flags);
}

Result<TileSections> read_tile_sections(ByteSpan bytes, const MapSchema& schema, const DecodeLimits& limits) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(TileSections s, read_start(in, schema, limits));
  const std::size_t coded = coded_channels(schema, s.header.codec).size();
  // The last section has no length: it is what is left.
  s.geometry = coded == 0 ? in.raw(in.left()) : in.sized();
  for (std::size_t i = 0; i < coded; ++i)
    s.channels.push_back(i + 1 == coded ? in.raw(in.left()) : in.sized());
  MAPCODEC_TRY(in.status("tile sections"));
  return s;
}

Result<TileSections> read_tile_prefix(ByteSpan bytes, const MapSchema& schema, const DecodeLimits& limits) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(TileSections s, read_start(in, schema, limits));
  const bool alone = coded_channels(schema, s.header.codec).empty();
  const std::uint64_t size = alone ? in.left() : in.varint();
  MAPCODEC_TRY(in.status("tile sections"));
  s.geometry = in.raw(size < in.left() ? size : in.left());
  return s;
}

}  // namespace mapcodec
