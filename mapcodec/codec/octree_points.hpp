// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// Decodes an octree stream (octree_encoder.hpp) to one cell per point, in Morton order, equal ones adjacent.
/// @param bytes   may be hostile.
/// @param points  how many the stream must hold.
/// @param depth   levels, as given to the encoder.
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<std::vector<VoxelCoord>> decode_octree_points(ByteSpan bytes, std::uint64_t points,
                                                                   std::uint32_t depth,
                                                                   const DecodeLimits& limits);

}  // namespace mapcodec
