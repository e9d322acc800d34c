// SPDX-License-Identifier: GPL-3.0-or-later
// Decoder of the `lossless` geometry (FORMAT.md 5).
#pragma once

#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// One entry per point.
struct LosslessDecoded {
  std::vector<Vec3> xyz;           ///< [m, map frame] in every bit as encoded
  std::vector<VoxelCoord> voxels;  ///< Morton order, equal ones adjacent; points that are not finite come
                                   ///< last, in the last finite point's voxel
};

/// Decodes what encode_lossless wrote.
/// @param bytes   may be hostile.
/// @param count   points that the tile's header declares.
/// @param format  as given to encode_lossless. @param origin  not needed: the grids are anchored at zero.
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<LosslessDecoded> decode_lossless(ByteSpan bytes, std::uint64_t count,
                                                      const CoordinateFormat& format, const Vec3& origin,
                                                      const DecodeLimits& limits);

}  // namespace mapcodec
