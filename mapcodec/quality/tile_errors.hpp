// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

/// Measures one tile by nearest neighbours in both directions, for codecs whose points are not the original's
/// one by one. Colour is compared where both have it; color_error is the mean of both directions. Non-finite
/// points are left out; a tile without points on one side has infinite errors, without points on both none.
/// Threads: pure.
[[nodiscard]] TileErrors measure_tile(const PointCloud& original, const PointCloud& decoded);

}  // namespace mapcodec
