// SPDX-License-Identifier: GPL-3.0-or-later
// Codings that keep an rms: of one tile, or of several together.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

/// A tile to be coded.
struct RmsTile {
  PointCloud points;
  TileBorders borders;  ///< where other tiles lie beside it
};

/// The cheapest coding of a tile whose own error, in both directions, keeps to `rms_m`.
/// Errors: those of encode_tile; PromiseBroken.
[[nodiscard]] Result<EncodedTile> encode_for_rms(const RmsTile& tile, const MapSchema& schema, double rms_m);

/// Runs body(i) for each i below a count, on several threads perhaps; the first error by number.
using RunEach = std::function<Status(std::size_t, const std::function<Status(std::size_t)>&)>;

/// Codes tiles so that the error of all their points together keeps to `rms_m`: the promise is spent where it
/// saves most. The same bytes by any number of threads. Errors: those of encode_for_rms.
[[nodiscard]] Result<std::vector<EncodedTile>> encode_for_rms_together(std::span<const RmsTile> tiles,
                                                                       const MapSchema& schema, double rms_m,
                                                                       const RunEach& run);

}  // namespace mapcodec
