// SPDX-License-Identifier: GPL-3.0-or-later
// One tile by the `surface` codec: geometry, channels on the resampled points, and what both lost. Encoder
// only.
#pragma once

#include <vector>

#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/codec/tile_memo.hpp"

namespace mapcodec {

struct SurfaceTile {
  Bytes geometry;
  std::vector<Bytes> channels;   ///< sections, as coded_channels lists them
  Box bounds;                    ///< of the decoded points
  TileErrors errors;             ///< max_axis_error_m is an upper bound
  double rms_forward_m = 0;      ///< original -> decoded
  double rms_backward_m = 0;     ///< decoded -> original
  double least_color_error = 0;  ///< that the positions allow, about; 0 without bounded colour
};

/// @param tile  at least one point; channels as in schema.channels.
/// @param step_m  surface step. @param settings  effort, color_slope, rough_errors. @param memo  as for
/// encode_tile.
/// Errors: InvalidArgument (as encode_surface and encode_channel).
[[nodiscard]] Result<SurfaceTile> encode_surface_tile(const PointCloud& tile, const MapSchema& schema,
                                                      double step_m, const TileSettings& settings,
                                                      TileMemo* memo = nullptr);

}  // namespace mapcodec
