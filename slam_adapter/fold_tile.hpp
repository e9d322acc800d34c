// SPDX-License-Identifier: GPL-3.0-or-later
// Points that are coded twice: pending, then for good.
#pragma once

#include <optional>

#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/codec/tile_segments.hpp"

namespace mapcodec {

/// How pending segments are coded: more exactly than promised, so that folding, which codes their points a
/// second and last time, has room for its own error. No point is ever coded a third time with loss: errors do
/// not build up however often a map is updated and compacted.
struct PendingCoding {
  TileSettings tiles;
  MapSchema schema;  ///< with the colour bound of pending segments
  double rms_m = 0;  ///< root mean square error that the step gives; 0 where the promise is not an rms
};
/// Errors: Unsupported (a map by the paper's method).
[[nodiscard]] Result<PendingCoding> pending_coding(const MapSchema& schema, Effort effort);

/// What a pending segment of `points` decodes to, in another order: without coding it, and without the
/// channels that novelty does not look at.
/// @param schema  of the map.
[[nodiscard]] PointCloud as_decoded(const PointCloud& points, const MapSchema& schema,
                                    const PendingCoding& coding);

/// A tile's content after folding.
struct Fold {
  std::uint8_t codec = 0;  ///< first byte of `bytes`
  std::uint64_t points = 0;
  Box bounds;  ///< [m, submap frame]
  TileErrors errors;
  Bytes bytes;                     ///< one payload, joined where the tile had a base that stays as it is
  std::uint64_t coded_points = 0;  ///< that were pending and were coded again, with loss or without
  double forward_m = 0, backward_m = 0;  ///< root mean square error of that coding, both directions
};

/// Codes points of one tile for good: the cheapest coding within the promise, or what of it pending ones
/// leave.
/// @param points  laid out as what a tile of `schema` decodes to. @param from_pending  they were coded
/// before. @param borders  of surfaces: where they go on in other tiles.
/// Errors: those of encoding; PromiseBroken.
[[nodiscard]] Result<EncodedTile> encode_for_good(PointCloud points, const MapSchema& schema,
                                                  bool from_pending, const TileBorders& borders);
/// What it codes by: the map's schema with the colour bound that pending points leave.
[[nodiscard]] MapSchema schema_for_good(const MapSchema& schema, bool from_pending);
/// Decoded points have no dropped channels; encoders want them in their places all the same.
[[nodiscard]] PointCloud with_all_channels(PointCloud cloud, const MapSchema& schema);
/// The same as one more pending segment: nothing is lost that was not lost before, where colours are exact.
[[nodiscard]] Result<EncodedTile> encode_pending(PointCloud points, const MapSchema& schema,
                                                 const PendingCoding& coding);
/// Whether decoding a folded tile and encoding it again changes nothing that decodes.
[[nodiscard]] bool is_exact_again(const MapSchema& schema);
/// Whether colours are kept within a bound: then each coding moves them.
[[nodiscard]] bool has_bounded_color(const MapSchema& schema);
/// Of a tile of which a share was coded again, each with its own error.
[[nodiscard]] TileErrors joint_errors(const TileErrors& tile, const TileErrors& again, double share);

}  // namespace mapcodec
