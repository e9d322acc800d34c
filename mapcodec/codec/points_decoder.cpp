// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/points_decoder.hpp"

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/codec/octree_points.hpp"
#include "mapcodec/codec/points_layout.hpp"

namespace mapcodec {

Result<PointsHeader> read_points_header(ByteReader& in) {
  PointsHeader header;
  for (std::int64_t& b : header.base) b = in.signed_varint();
  header.depth = in.u8();
  MAPCODEC_TRY(in.status("points header"));
  for (const std::int64_t b : header.base) {
    if (b > kMostLattice || b < -kMostLattice)
      return make_error(ErrorCode::kMalformed, "points base out of range");
  }
  return header;
}

Result<DecodedPoints> decode_points(ByteSpan bytes, std::uint64_t count, const Quantizer& quantizer,
                                    const DecodeLimits& limits) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const PointsHeader header, read_points_header(in));
  if (count > limits.max_bytes / (sizeof(Vec3) + sizeof(VoxelCoord))) {
    return make_error(ErrorCode::kLimitExceeded, "points need more memory than allowed");
  }
  DecodedPoints points;
  MAPCODEC_ASSIGN(points.voxels, decode_octree_points(in.raw(in.left()), count, header.depth, limits));
  points.xyz = voxel_centres(points.voxels, header.base, quantizer);
  return points;
}

std::vector<Vec3> voxel_centres(const std::vector<VoxelCoord>& voxels, const LatticeCoord& base,
                                const Quantizer& quantizer) {
  std::vector<Vec3> centres(voxels.size());
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      centres[i][axis] = quantizer.centre(base[axis] + voxels[i][axis], axis);
    }
  }
  return centres;
}

}  // namespace mapcodec
