// SPDX-License-Identifier: GPL-3.0-or-later
// One channel of one tile from bytes.
#pragma once

#include <span>

#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// Decodes what encode_channel wrote; for kept == constant, which has no bytes, repeats the constant.
/// @param bytes   may be hostile.
/// @param voxels  of the decoded points, as given to encode_channel.
/// @return as many values as voxels.
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<Channel> decode_channel(ByteSpan bytes, const ChannelSchema& schema,
                                             std::span<const VoxelCoord> voxels, const DecodeLimits& limits);

}  // namespace mapcodec
