// SPDX-License-Identifier: GPL-3.0-or-later
// The metadata block of a commit (FORMAT.md, Metadata).
#pragma once

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "maps/map_types.hpp"

namespace mapcodec {

/// Checks what a block can hold. Errors: InvalidArgument (tile size not positive, anything not finite,
/// negative errors).
[[nodiscard]] Status check_info(const MapInfo& info);

/// @param info         passed by check_info.
/// @param tile_points  sum of the points of all tiles at this revision.
[[nodiscard]] Bytes encode_metadata(const MapInfo& info, std::uint64_t tile_points);

/// What a block says; `info.input_points` still lacks the points of the tiles (add with wrap-around).
/// Errors: Truncated, Malformed.
[[nodiscard]] Result<MapInfo> decode_metadata(ByteSpan bytes);

/// As four numbers: rms_m, max_axis_error_m, color_error, density_error.
[[nodiscard]] inline std::array<double, 4> to_array(const TileErrors& e) {
  return {e.rms_m, e.max_axis_error_m, e.color_error, e.density_error};
}
[[nodiscard]] inline TileErrors to_errors(const std::array<double, 4>& e) {
  return {e[0], e[1], e[2], e[3]};
}
/// The smallest float that is not below `value`, which a float can hold.
[[nodiscard]] float round_up_to_float(double value);
/// True if none is negative, NaN, or beyond the largest float.
[[nodiscard]] bool is_valid(const TileErrors& errors);

}  // namespace mapcodec
