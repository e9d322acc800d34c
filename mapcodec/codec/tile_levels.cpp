// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/tile_levels.hpp"

#include "mapcodec/codec/octree_points.hpp"
#include "mapcodec/codec/points_layout.hpp"
#include "mapcodec/codec/surface_decoder.hpp"
#include "mapcodec/codec/surface_layout.hpp"
#include "mapcodec/codec/tile_sections.hpp"
#include "mapcodec/codec/tile_segments.hpp"

namespace mapcodec {
namespace {

/// How often a cube of 2^depth cells has to be halved for the parts to be at most so large; depth at most.
unsigned halvings(unsigned depth, double cell_m, double side_m) {
  unsigned n = 0;
  while (n < depth && std::ldexp(cell_m, static_cast<int>(depth - n)) > side_m) ++n;
  return n;
}

double side_at(const MapSchema& schema, unsigned level) {
  return std::ldexp(schema.tile_size_m, -static_cast<int>(level < kMostTileLevel ? level : kMostTileLevel));
}

Status check_step(double step_m) {
  if (step_m > 0 && std::isfinite(step_m)) return {};
  return make_error(ErrorCode::kMalformed, "tile has no voxel size");
}

Result<unsigned> surface_halvings(ByteSpan geometry, double step_m, double side_m) {
  ByteReader in(geometry);
  MAPCODEC_ASSIGN(const surface::Header header, surface::read_header(in));
  return halvings(header.depth, step_m / surface::kStepUnits, side_m);
}

Result<std::vector<Vec3>> coarse_surface(const TileSections& s, const Quantizer& lattice, double side_m,
                                         const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const unsigned n, surface_halvings(s.geometry, s.step_m, side_m));
  const unsigned levels = side_m > 0 ? 3 * n : kAllSurfaceLevels;
  MAPCODEC_ASSIGN(DecodedPoints d, decode_surface(s.geometry, s.header.points, lattice, limits, levels));
  return std::move(d.xyz);
}

Result<std::vector<Vec3>> coarse_points(const TileSections& s, const Quantizer& lattice, double side_m,
                                        const DecodeLimits& limits) {
  ByteReader in(s.geometry);
  MAPCODEC_ASSIGN(const PointsHeader header, read_points_header(in));
  if (s.header.points > limits.max_bytes / (sizeof(Vec3) + sizeof(VoxelCoord))) {
    return make_error(ErrorCode::kLimitExceeded, "points need more memory than allowed");
  }
  // The counts come after all levels: the first bytes alone would not do.
  MAPCODEC_ASSIGN(std::vector<VoxelCoord> voxels,
                  decode_octree_points(in.raw(in.left()), s.header.points, header.depth, limits));
  const unsigned cut = header.depth - halvings(header.depth, s.step_m, side_m);
  if (cut == 0) return voxel_centres(voxels, header.base, lattice);
  // The centre of a larger cell lies between voxels: on the lattice of half their side.
  const Quantizer finer{lattice.origin, lattice.step_m / 2, lattice.kind};
  std::vector<Vec3> xyz(voxels.size());
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    for (std::size_t d = 0; d < 3; ++d) {
      const std::int64_t corner = header.base[d] + (std::int64_t{voxels[i][d] >> cut} << cut);
      xyz[i][d] = (finer.centre(2 * corner + (std::int64_t{1} << cut) - 1, d) +
                   finer.centre(2 * corner + (std::int64_t{1} << cut), d)) /
                  2;
    }
  }
  return xyz;
}

}  // namespace

Result<PointCloud> decode_tile_coarsely(ByteSpan bytes, const MapSchema& schema, unsigned level,
                                        const DecodeLimits& limits) {
  if (is_joined(bytes)) {
    PointCloud none;
    none.coordinates = schema.coordinates;
    return decode_segments(bytes, none, limits, [&](ByteSpan segment, const DecodeLimits& left) {
      return decode_tile_coarsely(segment, schema, level, left);
    });
  }
  MAPCODEC_ASSIGN(const TileSections s, read_tile_prefix(bytes, schema, limits));
  PointCloud cloud;
  cloud.coordinates = schema.coordinates;
  if (s.header.codec != CodecId::surface && s.header.codec != CodecId::points) {
    MAPCODEC_ASSIGN(cloud, decode_tile(bytes, schema, limits));
    cloud.channels.clear();
    return cloud;
  }
  MAPCODEC_TRY(check_step(s.step_m));
  const Quantizer lattice{schema.origin, s.step_m, schema.coordinates.kind};
  const double side_m = level >= kMostTileLevel ? 0 : side_at(schema, level);
  const auto decode = s.header.codec == CodecId::surface ? coarse_surface : coarse_points;
  MAPCODEC_ASSIGN(cloud.xyz, decode(s, lattice, side_m, limits));
  return cloud;
}

Result<unsigned> count_tile_levels(ByteSpan bytes, const MapSchema& schema, const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const TileSections s, read_tile_prefix(bytes, schema, limits));
  if (s.header.codec == CodecId::surface) {
    MAPCODEC_ASSIGN(const std::vector<std::uint64_t> ends, tile_level_bytes(bytes, schema, limits));
    return static_cast<unsigned>(ends.size());
  }
  if (s.header.codec != CodecId::points) return 1u;
  MAPCODEC_TRY(check_step(s.step_m));
  unsigned level = 0;
  while (level < kMostTileLevel && side_at(schema, level) > s.step_m) ++level;
  return level + 1;
}

Result<std::vector<std::uint64_t>> tile_level_bytes(ByteSpan bytes, const MapSchema& schema,
                                                    const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const TileSections s, read_tile_prefix(bytes, schema, limits));
  if (s.header.codec != CodecId::surface) return std::vector<std::uint64_t>{bytes.size()};
  MAPCODEC_TRY(check_step(s.step_m));
  MAPCODEC_ASSIGN(const std::vector<std::uint64_t> ends,
                  surface_level_bytes(s.geometry, s.header.points, limits));
  const auto before = static_cast<std::uint64_t>(s.geometry.data() - bytes.data());
  std::vector<std::uint64_t> r;
  for (unsigned level = 0; level <= kMostTileLevel; ++level) {
    MAPCODEC_ASSIGN(const unsigned n, surface_halvings(s.geometry, s.step_m, side_at(schema, level)));
    r.push_back(before + ends[n < ends.size() ? n : ends.size() - 1]);
    if (n + 1 >= ends.size()) break;
  }
  return r;
}

}  // namespace mapcodec
