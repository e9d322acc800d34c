// SPDX-License-Identifier: GPL-3.0-or-later
// Channels of points that are not the sensor's own any more.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/cloud/map_schema.hpp"
#include "slam_adapter/tile_sample.hpp"

namespace mapcodec {

/// How the channels of `schema` are kept when points are resampled from surfaces: what belongs to one ray
/// (time, ring and the like) not at all; labels as they are; measured values within a 64th of their range on
/// the sample, which is below what resampling itself changes. `warnings` says so, one sentence each.
[[nodiscard]] std::vector<ChannelSchema> resampled_channels(const MapSchema& schema, const TileSample& sample,
                                                            std::vector<std::string>& warnings);

}  // namespace mapcodec
