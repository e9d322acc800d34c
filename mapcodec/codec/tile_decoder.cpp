// SPDX-License-Identifier: GPL-3.0-or-later
// Tile payload to points: the header, then the geometry section, then one section per stored channel
// (FORMAT.md 3).
#include "mapcodec/attribute/channel_decoder.hpp"
#include "mapcodec/codec/lossless_decoder.hpp"
#include "mapcodec/codec/occupancy_decoder.hpp"
#include "mapcodec/codec/paper_decoder.hpp"
#include "mapcodec/codec/points_decoder.hpp"
#include "mapcodec/codec/surface_decoder.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/codec/tile_sections.hpp"
#include "mapcodec/codec/tile_segments.hpp"

namespace mapcodec {
namespace {

struct Geometry {
  std::vector<Vec3> xyz;
  std::vector<VoxelCoord> voxels;
};

Result<Geometry> decode_geometry(const TileSections& s, const MapSchema& schema, const DecodeLimits& limits) {
  if (s.header.codec == CodecId::lossless) {
    MAPCODEC_ASSIGN(LosslessDecoded d,
                    decode_lossless(s.geometry, s.header.points, schema.coordinates, schema.origin, limits));
    return Geometry{std::move(d.xyz), std::move(d.voxels)};
  }
  if (!(s.step_m > 0) || !std::isfinite(s.step_m))
    return make_error(ErrorCode::kMalformed, "tile has no voxel size");
  const Quantizer lattice{schema.origin, s.step_m, schema.coordinates.kind};
  const bool surface = s.header.codec == CodecId::surface;
  MAPCODEC_ASSIGN(DecodedPoints d, surface ? decode_surface(s.geometry, s.header.points, lattice, limits)
                                           : decode_points(s.geometry, s.header.points, lattice, limits));
  if (!s.channels.empty() && d.voxels.size() != d.xyz.size()) {
    return make_error(ErrorCode::kMalformed, "surface tile has channels but no order for them");
  }
  return Geometry{std::move(d.xyz), std::move(d.voxels)};
}

Result<PointCloud> decode_with_channels(const TileSections& s, const MapSchema& schema,
                                        const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(Geometry g, decode_geometry(s, schema, limits));
  PointCloud cloud;
  cloud.coordinates = schema.coordinates;
  const std::size_t n = g.xyz.size();
  cloud.xyz = std::move(g.xyz);
  std::size_t next = 0;
  for (const ChannelSchema& c : schema.channels) {
    if (c.kept == ChannelKept::dropped) continue;
    if (c.info.stride() * n > limits.max_bytes) {
      return make_error(ErrorCode::kLimitExceeded,
                        "channel '" + c.info.name + "' would need too much memory");
    }
    const ByteSpan section = c.kept == ChannelKept::constant ? ByteSpan{} : s.channels[next++];
    // A surface tile without coded channels has no voxels, but a constant needs to know for how many points.
    if (c.kept == ChannelKept::constant) g.voxels.resize(n);
    MAPCODEC_ASSIGN(Channel values, decode_channel(section, c, g.voxels, limits));
    cloud.channels.push_back(std::move(values));
  }
  return cloud;
}

}  // namespace

Result<PointCloud> decode_tile(ByteSpan bytes, const MapSchema& schema, const DecodeLimits& limits) {
  if (is_joined(bytes)) {
    return decode_segments(bytes, schema.layout(), limits, [&](ByteSpan segment, const DecodeLimits& left) {
      return decode_tile(segment, schema, left);
    });
  }
  MAPCODEC_ASSIGN(const TileSections s, read_tile_sections(bytes, schema, limits));
  if (s.header.codec == CodecId::paper) return decode_paper(s.geometry, s.header.points, schema, limits);
  if (s.header.codec == CodecId::occupancy) {
    MAPCODEC_ASSIGN(const OccupancyPiece piece, decode_occupancy(s.geometry, s.header.points, limits));
    return occupancy_points(piece, schema, limits);
  }
  return decode_with_channels(s, schema, limits);
}

}  // namespace mapcodec
