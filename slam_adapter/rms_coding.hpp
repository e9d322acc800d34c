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
/// @param start_m  step of surfaces to begin with; 0: as the schema says.
/// Errors: those of encode_tile; PromiseBroken.
[[nodiscard]] Result<EncodedTile> encode_for_rms(const RmsTile& tile, const MapSchema& schema, double rms_m,
                                                 double start_m = 0);

/// Runs body(i) for each i below a count, on several threads perhaps; the first error by number.
using RunEach = std::function<Status(std::size_t, const std::function<Status(std::size_t)>&)>;

/// Codes tiles so that the error of all their points together keeps to `rms_m`: at one step, which spends the
/// promise where it saves most, or each within the promise where that is smaller. Which it is does not depend
/// on threads. Errors: those of encode_for_rms.
[[nodiscard]] Result<std::vector<EncodedTile>> encode_for_rms_together(std::span<const RmsTile> tiles,
                                                                       const MapSchema& schema, double rms_m,
                                                                       const RunEach& run);

}  // namespace mapcodec
