// SPDX-License-Identifier: GPL-3.0-or-later
// A tile that grew far beyond the others becomes smaller ones.
#pragma once

#include "slam_adapter/fold_tile.hpp"

namespace mapcodec {

/// Key in MapInfo::extras: one byte, the level of tiles in open space, so that there are smaller ones to
/// split them into.
inline constexpr const char* kNewTileLevelExtra = "new_tile_level";

/// One of the up to eight parts of a tile, each as a tile of its own.
struct TilePart {
  TileKey key;  ///< one level below
  Fold tile;
};

/// Splits a tile. Positions that pending segments hold, or that are exact, are coded again without loss;
/// where colours are within a bound, the parts are folded for good instead, each as if nothing lay beside it.
/// @param segments  base, then deltas. @param errors  of the tile; those of its parts are not known apart.
/// @return nothing where it cannot be: a tile of the lowest level, or one with points that were coded with
/// loss for good. Pure. Errors: as fold_tile.
[[nodiscard]] Result<std::optional<std::vector<TilePart>>> split_tile(const TileKey& key,
                                                                      const std::vector<Bytes>& segments,
                                                                      const MapSchema& schema,
                                                                      const PendingCoding& coding,
                                                                      const TileErrors& errors);

}  // namespace mapcodec
