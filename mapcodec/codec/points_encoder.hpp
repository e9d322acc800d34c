// SPDX-License-Identifier: GPL-3.0-or-later
// Encoder of the `points` geometry: every point within half a step per axis (FORMAT.md 6).
#pragma once

#include <span>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

struct PointsSettings {
  Effort effort = Effort::standard;
  bool keep_counts = true;  ///< false: one point per occupied voxel is decoded
};

/// A tile's bytes and what its decoder will make of them.
struct PointsEncoding {
  Bytes bytes;  ///< read by decode_points
  std::vector<std::uint32_t>
      order;  ///< decoded point i is input point order[i] (or stands for it, counts off)
  std::vector<VoxelCoord>
      voxels;  ///< of the decoded points, from the tile's base; Morton order, equal ones adjacent
  std::vector<Vec3> decoded;     ///< [m, map frame], as decode_points gives them
  double sum_squared_error = 0;  ///< [m^2] over all input points, to the point that stands for each
  double max_axis_error_m = 0;   ///< largest error of an input point along one axis
};

/// Encodes the positions of one tile. Pure: same input, same bytes, any thread.
/// @param xyz  points [m, map frame]; not empty, all within 2^21 cells of each other per axis.
/// Errors: Empty; InvalidArgument (step not positive, non-finite or too distant points, a lattice finer than
/// 2^21 cells a side).
[[nodiscard]] Result<PointsEncoding> encode_points(std::span<const Vec3> xyz, const Quantizer& quantizer,
                                                   const PointsSettings& settings);

}  // namespace mapcodec
