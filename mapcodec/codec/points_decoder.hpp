// SPDX-License-Identifier: GPL-3.0-or-later
// Decoder of the `points` geometry (FORMAT.md 6).
#pragma once

#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// One entry per decoded point.
struct DecodedPoints {
  std::vector<Vec3> xyz;           ///< [m, map frame] centres of the voxels
  std::vector<VoxelCoord> voxels;  ///< from the tile's base; Morton order, equal ones adjacent
};

/// Decodes what encode_points wrote.
/// @param bytes  may be hostile.
/// @param count  points that the tile's header declares.
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<DecodedPoints> decode_points(ByteSpan bytes, std::uint64_t count,
                                                  const Quantizer& quantizer, const DecodeLimits& limits);

}  // namespace mapcodec
