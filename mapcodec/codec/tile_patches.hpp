// SPDX-License-Identifier: GPL-3.0-or-later
// The surfaces of a tile payload, whatever codec it has, with their colours.
#pragma once

#include <vector>

#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/codec/surface_patches.hpp"

namespace mapcodec {

struct TilePatches {
  bool surfaces = false;     ///< the tile's codec keeps surfaces (`surface`, `paper`); else the rest is empty
  double step_m = 0;         ///< surface step of the tile; 0 where it has none (`paper`)
  std::uint64_t points = 0;  ///< of the tile, those on no patch included
  std::vector<SurfacePatch> patches;
};

/// Reads the patches of a tile: of a `surface` tile its leaves, of a `paper` one its triangles. Where the
/// schema keeps a colour ("rgb", 3 of u8 or u16) they have the mean of the decoded colours of their points;
/// else a `surface` tile's points are not spread at all unless it has blocks.
/// @param bytes  payload, may be hostile. Errors: as decode_tile. Threads: pure.
[[nodiscard]] Result<TilePatches> read_tile_patches(ByteSpan bytes, const MapSchema& schema,
                                                    const DecodeLimits& limits = {});

}  // namespace mapcodec
