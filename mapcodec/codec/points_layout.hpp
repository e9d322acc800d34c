// SPDX-License-Identifier: GPL-3.0-or-later
// What encoder and decoder of `points` share: the header before the octree, and where voxels lie.
#pragma once

#include <array>
#include <vector>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

using LatticeCoord = std::array<std::int64_t, 3>;  ///< cell of a map's lattice

inline constexpr std::int64_t kMostLattice = std::int64_t{1} << 52;  ///< largest magnitude of a base

struct PointsHeader {
  LatticeCoord base{0, 0, 0};  ///< cell of voxel (0, 0, 0)
  std::uint8_t depth = 0;      ///< levels of the octree: voxel coordinates are below 2^depth
};

/// Errors: Truncated, Malformed.
[[nodiscard]] Result<PointsHeader> read_points_header(ByteReader& in);

/// Centre [m, map frame] of each voxel.
[[nodiscard]] std::vector<Vec3> voxel_centres(const std::vector<VoxelCoord>& voxels, const LatticeCoord& base,
                                              const Quantizer& quantizer);

}  // namespace mapcodec
