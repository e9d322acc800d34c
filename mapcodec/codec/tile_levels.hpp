// SPDX-License-Identifier: GPL-3.0-or-later
// Tiles in less detail, from their first bytes.
#pragma once

#include <vector>

#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

/// Level of detail: cells of at most schema.tile_size_m / 2^level a side, in every tile of the map. Level 0
/// is the coarsest; from this level on everything is there.
inline constexpr unsigned kMostTileLevel = 40;

/// Where the points of one tile payload lie at a level of detail; as many points as the tile has, without
/// channels, which fit only the whole. Of a `surface` tile the octree is decoded down to cells of that side
/// and the points are spread over the surface as it stands there; of a `points` tile they lie at the
/// centres of such cells. `lossless` and `paper` tiles have no levels: they come in full.
/// @param bytes  payload, may be hostile; of a `surface` tile the first tile_level_bytes()[level] are enough.
/// Errors, threads: as decode_tile.
[[nodiscard]] Result<PointCloud> decode_tile_coarsely(ByteSpan bytes, const MapSchema& schema, unsigned level,
                                                      const DecodeLimits& limits = {});

/// Number of levels of a payload: the last of them and all further ones give every detail. 1 where a tile has
/// none. Errors, threads: as decode_tile.
[[nodiscard]] Result<unsigned> count_tile_levels(ByteSpan bytes, const MapSchema& schema,
                                                 const DecodeLimits& limits = {});

/// Bytes of a payload, from the first, that decode_tile_coarsely needs for level 0, 1, ...: never falling,
/// and the last is enough for all further levels. Only a `surface` tile's first bytes are of use alone:
/// others have one number, their size. Takes about as long as decoding without spreading points.
/// Errors, threads: as decode_tile.
[[nodiscard]] Result<std::vector<std::uint64_t>> tile_level_bytes(ByteSpan bytes, const MapSchema& schema,
                                                                  const DecodeLimits& limits = {});

}  // namespace mapcodec
