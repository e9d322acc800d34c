// SPDX-License-Identifier: GPL-3.0-or-later
// Encoder of the `lossless` geometry: a shallow octree, then the plain remaining bits of each coordinate.
#pragma once

#include <span>
#include <vector>

#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

struct LosslessEncoding {
  Bytes bytes;
  std::vector<std::uint32_t> order;  ///< decoded point i is input point order[i]
  std::vector<VoxelCoord> voxels;    ///< of the decoded points, as the decoder will give them
};

/// Keeps every bit of every coordinate.
/// @param xyz     [m, map frame]; may hold NaN, infinities and -0, which are kept too (a NaN's payload as far
/// as the
///                conversion to double kept it).
/// @param format  how the source wrote its numbers; numbers that it cannot hold are kept all the same.
/// @param origin  not needed: the grids are anchored at zero, so that the same numbers give the same cells.
/// Errors: InvalidArgument (2^32 points or more). Threads: pure; same input, same bytes.
[[nodiscard]] Result<LosslessEncoding> encode_lossless(std::span<const Vec3> xyz,
                                                       const CoordinateFormat& format, const Vec3& origin,
                                                       Effort effort);

}  // namespace mapcodec
