// SPDX-License-Identifier: GPL-3.0-or-later
// Encoder of the `paper` codec [Morell, Orts, Cazorla, Garcia-Rodriguez, Geometric 3D point cloud
// compression, Pattern Recognition Letters 2014, Algorithm 1] (FORMAT.md 7).
#pragma once

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

struct PaperStats {
  std::uint64_t planes = 0;
  std::uint64_t triangles = 0;
  std::uint64_t leftover_points = 0;  ///< stored as points
  std::uint64_t plane_bytes = 0;  ///< of the bytes, what describes the planes, their colours and counts too
};

struct PaperEncoding {
  Bytes bytes;                       ///< read by decode_paper
  std::uint64_t points = 0;          ///< that the decoder will give: as many as went in
  std::uint64_t geometry_bytes = 0;  ///< of `bytes`, what is not the remaining points' colour
  PaperStats stats;
};

/// Encodes one tile. Pure: same input, same bytes, any thread.
/// @param tile    points [m, map frame], channels as in schema.channels.
/// @param schema  keeps no channel but "rgb" (u8x3 or u16x3) and constants.
/// Errors: InvalidArgument (no point, a non-finite point, settings out of range, a schema that keeps more, a
/// tile of more than 2^24 vertex steps a side).
[[nodiscard]] Result<PaperEncoding> encode_paper(const PointCloud& tile, const MapSchema& schema,
                                                 const PaperSettings& settings);

}  // namespace mapcodec
