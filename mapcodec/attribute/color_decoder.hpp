// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/channel.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// Whether a channel of this layout can be coded as a "colour" section.
[[nodiscard]] inline bool is_color(const ChannelInfo& info) {
  return info.name == "rgb" && info.components == 3 &&
         (info.scalar == ScalarType::u8 || info.scalar == ScalarType::u16);
}

/// Decodes a "colour" section (FORMAT.md 8.5).
/// @param voxels  Morton-sorted, coordinates below 2^21.
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<Channel> decode_color(ByteSpan bytes, const ChannelInfo& info,
                                           std::span<const VoxelCoord> voxels, const DecodeLimits& limits);

}  // namespace mapcodec
