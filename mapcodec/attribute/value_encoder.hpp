// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// Encodes any channel, exactly or each value within schema.bound, as a "values" section (FORMAT.md 8.3).
/// @param values  in decoded order. @param voxels  of the same points.
/// Threads: pure; same input, same bytes.
[[nodiscard]] Bytes encode_values(const ChannelSchema& schema, const Channel& values,
                                  std::span<const VoxelCoord> voxels, Effort effort);

}  // namespace mapcodec
