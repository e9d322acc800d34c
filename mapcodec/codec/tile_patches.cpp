// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/tile_patches.hpp"

#include <optional>

#include "mapcodec/attribute/channel_decoder.hpp"
#include "mapcodec/codec/paper_decoder.hpp"
#include "mapcodec/codec/tile_sections.hpp"
#include "mapcodec/codec/tile_segments.hpp"

namespace mapcodec {
namespace {

/// Index of the channel with colours, if the schema keeps one.
std::optional<std::size_t> color_of(const MapSchema& schema) {
  for (std::size_t i = 0; i < schema.channels.size(); ++i) {
    const ChannelSchema& c = schema.channels[i];
    const bool fits = c.info.scalar == ScalarType::u8 || c.info.scalar == ScalarType::u16;
    if (c.info.name == "rgb" && c.info.components == 3 && fits && c.kept != ChannelKept::dropped) return i;
  }
  return std::nullopt;
}

double color_scale(const ChannelInfo& info) {
  return info.scalar == ScalarType::u16 ? 1.0 / 257 : 1.0;
}

double color_at(const Channel& channel, std::size_t i, std::size_t c) {
  const double v = channel.info.scalar == ScalarType::u16 ? channel.get<std::uint16_t>(i, c)
                                                          : channel.get<std::uint8_t>(i, c);
  return v * color_scale(channel.info);
}

void average_colors(const Channel& colors, SurfacePatchPoints& tile) {
  std::vector<std::uint64_t> count(tile.patches.size(), 0);
  for (std::size_t i = 0; i < tile.patch_of.size(); ++i) {
    const std::uint32_t p = tile.patch_of[i];
    if (p == kNoPatch) continue;
    ++count[p];
    for (std::size_t c = 0; c < 3; ++c) tile.patches[p].rgb[c] += color_at(colors, i, c);
  }
  for (std::size_t p = 0; p < count.size(); ++p) {
    tile.patches[p].colored = count[p] > 0;
    for (double& v : tile.patches[p].rgb) v /= count[p] > 0 ? static_cast<double>(count[p]) : 1.0;
  }
}

/// Section of a coded channel.
Result<ByteSpan> section_of(const TileSections& s, const MapSchema& schema, std::size_t channel) {
  const std::vector<std::size_t> coded = coded_channels(schema, s.header.codec);
  for (std::size_t i = 0; i < coded.size() && i < s.channels.size(); ++i) {
    if (coded[i] == channel) return s.channels[i];
  }
  return make_error(ErrorCode::kMalformed, "tile has no colour section");
}

Result<std::vector<SurfacePatch>> colored_patches(const TileSections& s, const Quantizer& lattice,
                                                  const MapSchema& schema, std::size_t color,
                                                  const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(SurfacePatchPoints tile,
                  read_surface_patch_points(s.geometry, s.header.points, lattice, limits));
  MAPCODEC_ASSIGN(const ByteSpan section, section_of(s, schema, color));
  const ChannelSchema& channel = schema.channels[color];
  if (channel.info.stride() * tile.voxels.size() > limits.max_bytes)
    return make_error(ErrorCode::kLimitExceeded, "colours would need too much memory");
  MAPCODEC_ASSIGN(const Channel colors, decode_channel(section, channel, tile.voxels, limits));
  if (colors.size() != tile.voxels.size())
    return make_error(ErrorCode::kMalformed, "tile has not a colour for each point");
  average_colors(colors, tile);
  return std::move(tile.patches);
}

void color_all(std::vector<SurfacePatch>& patches, const ChannelSchema& schema) {
  const Channel constant{schema.info, schema.constant};
  if (constant.size() != 1) return;
  for (SurfacePatch& p : patches) {
    p.colored = true;
    for (std::size_t c = 0; c < 3; ++c) p.rgb[c] = color_at(constant, 0, c);
  }
}

Result<std::vector<SurfacePatch>> surface_patches(const TileSections& s, const MapSchema& schema,
                                                  const DecodeLimits& limits) {
  const Quantizer lattice{schema.origin, s.step_m, schema.coordinates.kind};
  const std::optional<std::size_t> color = color_of(schema);
  const bool constant = color && schema.channels[*color].kept == ChannelKept::constant;
  if (color && !constant) return colored_patches(s, lattice, schema, *color, limits);
  MAPCODEC_ASSIGN(std::vector<SurfacePatch> patches,
                  read_surface_patches(s.geometry, s.header.points, lattice, limits));
  if (constant) color_all(patches, schema.channels[*color]);
  return patches;
}

SurfacePatch patch_of(const PlanarPatch& plane, const PatchTriangle& t) {
  SurfacePatch p;
  Vec3 edge[2]{};
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& v = plane.vertices[t.vertices[i]];
    p.polygon.push_back(v);
    for (std::size_t d = 0; d < 3; ++d) {
      p.center[d] += v[d] / 3;
      if (i > 0) edge[i - 1][d] = v[d] - p.polygon[0][d];
    }
  }
  double facing = 0, squares = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    const std::size_t e = (d + 1) % 3, f = (d + 2) % 3;
    const double x = edge[0][e] * edge[1][f] - edge[0][f] * edge[1][e];
    facing += x * plane.normal[d];
    squares += x * x;
  }
  if (facing < 0) std::swap(p.polygon[1], p.polygon[2]);
  p.normal = plane.normal;
  p.area_m2 = std::sqrt(squares) / 2;
  p.points = t.points;
  return p;
}

Result<std::vector<SurfacePatch>> paper_patches(const TileSections& s, const MapSchema& schema,
                                                const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const std::vector<PlanarPatch> planes,
                  read_paper_patches(s.geometry, s.header.points, schema, limits));
  const std::optional<std::size_t> color = color_of(schema);
  std::vector<SurfacePatch> patches;
  for (const PlanarPatch& plane : planes) {
    for (const PatchTriangle& t : plane.triangles) {
      SurfacePatch p = patch_of(plane, t);
      p.colored = color.has_value();
      for (std::size_t c = 0; c < 3 && color; ++c)
        p.rgb[c] = t.rgb[c] * color_scale(schema.channels[*color].info);
      if (p.area_m2 > 0) patches.push_back(std::move(p));
    }
  }
  return patches;
}

/// Of a tile that was updated. A patch goes if its centre is erased.
Result<TilePatches> joined_patches(ByteSpan bytes, const MapSchema& schema, const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const std::vector<ByteSpan> segments, split_segments(bytes));
  TilePatches all;
  DecodeLimits left = limits;
  for (const ByteSpan segment : segments) {
    if (is_erasure(segment)) {
      MAPCODEC_ASSIGN(const Erasure e, read_erasure(segment));
      std::erase_if(all.patches, [&](const SurfacePatch& p) { return is_erased(e, p.center); });
      continue;
    }
    MAPCODEC_ASSIGN(TilePatches more, read_tile_patches(segment, schema, left));
    left.max_points -= std::min(left.max_points, more.points);
    all.surfaces = all.surfaces || more.surfaces;
    all.step_m = std::max(all.step_m, more.step_m);
    all.points += more.points;
    std::move(more.patches.begin(), more.patches.end(), std::back_inserter(all.patches));
  }
  return all;
}

}  // namespace

Result<TilePatches> read_tile_patches(ByteSpan bytes, const MapSchema& schema, const DecodeLimits& limits) {
  if (is_joined(bytes)) return joined_patches(bytes, schema, limits);
  MAPCODEC_ASSIGN(const TileSections s, read_tile_sections(bytes, schema, limits));
  TilePatches r;
  r.points = s.header.points;
  r.surfaces = s.header.codec == CodecId::surface || s.header.codec == CodecId::paper;
  if (s.header.codec == CodecId::surface) {
    r.step_m = s.step_m;
    MAPCODEC_ASSIGN(r.patches, surface_patches(s, schema, limits));
  } else if (s.header.codec == CodecId::paper) {
    MAPCODEC_ASSIGN(r.patches, paper_patches(s, schema, limits));
  }
  return r;
}

}  // namespace mapcodec
