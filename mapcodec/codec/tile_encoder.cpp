// SPDX-License-Identifier: GPL-3.0-or-later
// Points of one tile to its payload, and what that lost.
#include <cmath>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/lossless_encoder.hpp"
#include "mapcodec/codec/paper_decoder.hpp"
#include "mapcodec/codec/paper_encoder.hpp"
#include "mapcodec/codec/points_encoder.hpp"
#include "mapcodec/codec/surface_tile.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/codec/tile_color.hpp"
#include "mapcodec/codec/tile_sections.hpp"
#include "mapcodec/quality/density.hpp"
#include "mapcodec/quality/tile_errors.hpp"

namespace mapcodec {
namespace {

/// Geometry as any of the position-keeping codecs gives it.
struct Geometry {
  Bytes bytes;
  std::vector<std::uint32_t> order;  ///< decoded point i comes from input point order[i]
  std::vector<VoxelCoord> voxels;
  std::vector<Vec3> decoded;
  TileErrors errors;
};

Channel gather(const Channel& from, const std::vector<std::uint32_t>& order) {
  Channel to{from.info, Bytes(order.size() * from.info.stride())};
  for (std::size_t i = 0; i < order.size(); ++i) std::memcpy(to.at(i), from.at(order[i]), from.info.stride());
  return to;
}

/// The step that a tile is coded with.
double step_of(const MapSchema& schema, const TileSettings& settings) {
  return settings.step_m > 0 ? settings.step_m : schema.step_m;
}

Result<Geometry> encode_points_geometry(const PointCloud& tile, const MapSchema& schema,
                                        const TileSettings& settings) {
  const Quantizer lattice{schema.origin, step_of(schema, settings), schema.coordinates.kind};
  MAPCODEC_ASSIGN(PointsEncoding e,
                  encode_points(tile.xyz, lattice, {settings.effort, settings.keep_counts}));
  Geometry g{std::move(e.bytes), std::move(e.order), std::move(e.voxels), std::move(e.decoded), {}};
  // The nearest lattice point of an original is its own voxel's centre, and no centre is farther from its
  // nearest original than from its own: so the larger direction is this one, and no search is needed.
  g.errors.rms_m = std::sqrt(e.sum_squared_error / static_cast<double>(tile.size()));
  g.errors.max_axis_error_m = e.max_axis_error_m;
  if (settings.rough_errors) return g;
  const bool all_kept = g.order.size() == tile.size();
  g.errors.density_error =
      all_kept ? density_error_of_moved(tile.xyz, g.decoded, g.order) : density_error(tile.xyz, g.decoded);
  return g;
}

Result<Geometry> encode_lossless_geometry(const PointCloud& tile, const MapSchema& schema, Effort effort) {
  MAPCODEC_ASSIGN(LosslessEncoding e, encode_lossless(tile.xyz, schema.coordinates, schema.origin, effort));
  Geometry g{std::move(e.bytes), std::move(e.order), std::move(e.voxels), {}, {}};
  g.decoded.reserve(g.order.size());
  for (const std::uint32_t i : g.order) g.decoded.push_back(tile.xyz[i]);
  return g;
}

void append_section(ByteWriter& out, ByteSpan section, bool last) {
  // The last section needs no length: it is what is left.
  if (last) {
    out.raw(section);
  } else {
    out.sized(section);
  }
}

Box bounds_of(const std::vector<Vec3>& points) {
  Box b;
  for (const Vec3& p : points) {
    if (is_finite(p)) b.add(p);
  }
  return b;
}

/// @param step_m  of a codec with steps, 0 of others.
EncodedTile begin_tile(const PointCloud& tile, const MapSchema& schema, CodecId codec, std::uint64_t points,
                       double step_m, ByteWriter& out) {
  const bool own_step = step_m > 0 && step_m != schema.step_m;
  out.u8(static_cast<std::uint8_t>(codec));
  out.u8(own_step ? kTileFlagOwnStep : 0);
  out.varint(points);
  if (own_step) out.f64(step_m);
  EncodedTile r;
  r.codec = codec;
  r.points = points;
  r.input_points = tile.size();
  r.bounds = tile.bounds();
  return r;
}

bool is_bounded_color(const ChannelSchema& c) {
  return c.kept == ChannelKept::bounded && c.info.name == "rgb";
}

Result<EncodedTile> encode_with_channels(const PointCloud& tile, const MapSchema& schema,
                                         const TileSettings& settings) {
  MAPCODEC_ASSIGN(Geometry g, settings.codec == CodecId::lossless
                                  ? encode_lossless_geometry(tile, schema, settings.effort)
                                  : encode_points_geometry(tile, schema, settings));
  ByteWriter out;
  const double step_m = settings.codec == CodecId::points ? step_of(schema, settings) : 0;
  EncodedTile r = begin_tile(tile, schema, settings.codec, g.order.size(), step_m, out);
  const std::vector<std::size_t> coded = coded_channels(schema, settings.codec);
  append_section(out, g.bytes, coded.empty());
  r.geometry_bytes = out.size();
  for (const std::size_t c : coded) {
    const ChannelSchema& channel = schema.channels[c];
    const Channel values = gather(tile.channels[c], g.order);
    const ColorContext context{tile.xyz, g.order, g.voxels, g.decoded};
    MAPCODEC_ASSIGN(ChannelEncoding e, is_bounded_color(channel)
                                           ? encode_tile_color(channel, values, context, settings.effort)
                                           : encode_channel(channel, values, g.voxels, settings.effort));
    append_section(out, e.bytes, c == coded.back());
    if (is_bounded_color(channel)) g.errors.color_error = e.error;
  }
  r.bounds.add(bounds_of(g.decoded));
  r.errors = g.errors;
  r.rms_forward_m = r.rms_backward_m = g.errors.rms_m;
  r.bytes = out.take();
  return r;
}

Result<EncodedTile> encode_by_surfaces(const PointCloud& tile, const MapSchema& schema,
                                       const TileSettings& settings, TileMemo* memo) {
  const double step_m = step_of(schema, settings);
  MAPCODEC_ASSIGN(const SurfaceTile t, encode_surface_tile(tile, schema, step_m, settings, memo));
  ByteWriter out;
  EncodedTile r = begin_tile(tile, schema, CodecId::surface, tile.size(), step_m, out);
  append_section(out, t.geometry, t.channels.empty());
  r.geometry_bytes = out.size();
  for (const Bytes& section : t.channels) append_section(out, section, &section == &t.channels.back());
  r.bounds.add(t.bounds);
  r.errors = t.errors;
  r.rms_forward_m = t.rms_forward_m;
  r.rms_backward_m = t.rms_backward_m;
  r.least_color_error = t.least_color_error;
  r.bytes = out.take();
  return r;
}

#ifdef MAPCODEC_PAPER_ENCODER
Result<EncodedTile> encode_paper_tile(const PointCloud& tile, const MapSchema& schema,
                                      const TileSettings& settings) {
  MAPCODEC_ASSIGN(PaperEncoding e, encode_paper(tile, schema, settings.paper));
  ByteWriter out;
  EncodedTile r = begin_tile(tile, schema, CodecId::paper, e.points, 0, out);
  out.raw(e.bytes);
  r.geometry_bytes = e.geometry_bytes;
  r.bytes = out.take();
  // Resampled points must be looked at to know what was lost.
  MAPCODEC_ASSIGN(const PointCloud decoded, decode_tile(r.bytes, schema));
  r.errors = measure_tile(tile, decoded);
  r.rms_forward_m = r.rms_backward_m = r.errors.rms_m;
  r.bounds.add(decoded.bounds());
  return r;
}
#else
Result<EncodedTile> encode_paper_tile(const PointCloud&, const MapSchema&, const TileSettings&) {
  return make_error(ErrorCode::kUnsupported,
                    "this build has no encoder for the paper's method (MAPCODEC_PAPER_ENCODER)");
}
#endif

Status check_input(const PointCloud& tile, const MapSchema& schema, const TileSettings& settings) {
  if (tile.empty()) return make_error(ErrorCode::kInvalidArgument, "a tile without points");
  if (tile.size() > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::kInvalidArgument,
                      "a tile of more than 2^32 points: choose a smaller tile size");
  }
  if (tile.channels.size() != schema.channels.size()) {
    return make_error(ErrorCode::kInvalidArgument, "the points' channels are not the schema's");
  }
  const bool has_step = settings.codec == CodecId::points || settings.codec == CodecId::surface;
  if (has_step && !(step_of(schema, settings) > 0)) {
    return make_error(ErrorCode::kInvalidArgument, "the step must be positive");
  }
  return {};
}

}  // namespace

Result<EncodedTile> encode_tile(const PointCloud& tile, const MapSchema& schema, const TileSettings& settings,
                                TileMemo* memo) {
  MAPCODEC_TRY(check_input(tile, schema, settings));
  switch (settings.codec) {
    case CodecId::lossless:
    case CodecId::points:
      return encode_with_channels(tile, schema, settings);
    case CodecId::paper:
      return encode_paper_tile(tile, schema, settings);
    case CodecId::surface:
      return encode_by_surfaces(tile, schema, settings, memo);
    default:
      return make_error(ErrorCode::kUnknownCodec,
                        std::string("no encoder for codec ") + codec_name(settings.codec));
  }
}

}  // namespace mapcodec
