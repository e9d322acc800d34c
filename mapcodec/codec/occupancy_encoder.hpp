// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/cloud/occupancy_pieces.hpp"
#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

/// A subtree as the payload of a tile, exact. Pure: same input, same bytes.
/// @param piece  not empty.
/// @return points = leaves; bounds = those of the leaves' cubes [m, map frame].
[[nodiscard]] EncodedTile encode_occupancy_tile(const OccupancyPiece& piece, double resolution_m);

/// Largest piece to cut a tree into: larger ones code better and are read in larger bites.
inline constexpr std::uint64_t kOccupancyTileNodes = 131072;

}  // namespace mapcodec
