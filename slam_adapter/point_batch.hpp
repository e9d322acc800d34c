// SPDX-License-Identifier: GPL-3.0-or-later
// Points of any source as a map wants them.
#pragma once

#include "mapcodec/cloud/map_schema.hpp"

namespace mapcodec {

/// @param points  with channels in any order.
/// @param dropped  out: points left out because a coordinate was not finite (lossless maps keep them).
/// @return the points with exactly the channels of `schema`, dropped ones too (as zeros where they are not
/// there), in its order.
/// Errors: Malformed: a kept channel is missing or of another type; a constant channel has another value.
/// InvalidArgument: a lossless map of other coordinates.
[[nodiscard]] Result<PointCloud> fit_to_schema(PointCloud points, const MapSchema& schema,
                                               std::uint64_t& dropped);

/// Without the channels that the map does not keep: as its tiles decode.
[[nodiscard]] PointCloud without_dropped(PointCloud points, const MapSchema& schema);

/// Names of channels that `layout` has and `schema` does not know or keep.
[[nodiscard]] std::vector<std::string> unkept_channels(const PointCloud& layout, const MapSchema& schema);

}  // namespace mapcodec
