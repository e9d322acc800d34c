// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/cloud/occupancy_pieces.hpp"
#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

/// Decodes the payload of an occupancy tile, which may be hostile: the subtree and its place, exact.
/// @param bytes  FORMAT.md 3 and 12.
/// Errors: Truncated, Malformed, LimitExceeded, UnknownCodec. Threads: pure.
[[nodiscard]] Result<OccupancyPiece> decode_occupancy_tile(ByteSpan bytes, const DecodeLimits& limits = {});

/// The geometry section alone. @param leaves  as the tile's header says.
[[nodiscard]] Result<OccupancyPiece> decode_occupancy(ByteSpan section, std::uint64_t leaves,
                                                      const DecodeLimits& limits);

/// The leaves of a subtree as points: the centres, depth first, with the channels of `occupancy_schema`.
/// @param schema  its level-0 tile is a voxel. Errors: Malformed (the schema has other channels),
/// LimitExceeded.
[[nodiscard]] Result<PointCloud> occupancy_points(const OccupancyPiece& piece, const MapSchema& schema,
                                                  const DecodeLimits& limits = {});

/// The schema of a map of occupancy tiles. A leaf becomes a point: its centre, `occupied` (u8, 0 or 1) or
/// `log_odds` (f32), `height` (u8; its side is resolution * 2^height) and, where there are colours, `rgb`.
[[nodiscard]] MapSchema occupancy_schema(OccupancyKind kind, double resolution_m);

/// What a schema says of its occupancy tiles; nothing if it is not one of `occupancy_schema`.
[[nodiscard]] std::optional<OccupancyKind> occupancy_kind(const MapSchema& schema);

}  // namespace mapcodec
