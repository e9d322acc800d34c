// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/fold_tile.hpp"

#include <algorithm>
#include <cmath>

#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/quality/novelty.hpp"
#include "slam_adapter/point_batch.hpp"
#include "slam_adapter/rms_coding.hpp"

namespace mapcodec {
namespace {

// Pending positions have so much less than the promise that folding may add nearly all of it, since the two
// errors are independent: 0.15^2 + 0.98^2 < 1. (A quarter would save two bits a point until folding, and cost
// a twentieth of the size for good.)
constexpr double kPendingRms = 0.15;
// Colour errors are mean distances: they add up.
constexpr double kPendingColor = 0.3, kFoldedColor = 0.7;
// A uniform cell's root mean square distance from its centre, in sides.
constexpr double kRmsOfCell = 0.5;

ChannelSchema* bounded_color(MapSchema& schema) {
  for (ChannelSchema& c : schema.channels) {
    if (c.info.name == "rgb" && c.kept == ChannelKept::bounded) return &c;
  }
  return nullptr;
}

MapSchema with_color_share(MapSchema schema, double share) {
  if (ChannelSchema* color = bounded_color(schema)) color->bound *= share;
  return schema;
}

}  // namespace

PointCloud with_all_channels(PointCloud cloud, const MapSchema& schema) {
  std::vector<Channel> channels;
  std::size_t next = 0;
  for (const ChannelSchema& c : schema.channels) {
    if (c.kept == ChannelKept::dropped) {
      channels.push_back({c.info, Bytes(c.info.stride() * cloud.size())});
    } else {
      channels.push_back(std::move(cloud.channels[next++]));
    }
  }
  cloud.channels = std::move(channels);
  return cloud;
}

bool has_bounded_color(const MapSchema& schema) {
  MapSchema copy = schema;
  return bounded_color(copy) != nullptr;
}

bool is_exact_again(const MapSchema& schema) {
  return schema.promise == PromiseKind::lossless ||
         (schema.promise == PromiseKind::max_error && !has_bounded_color(schema));
}

MapSchema schema_for_good(const MapSchema& schema, bool from_pending) {
  return with_color_share(schema, from_pending ? kFoldedColor : 1);
}

Result<EncodedTile> encode_for_good(PointCloud points, const MapSchema& schema, bool from_pending,
                                    const TileBorders& borders) {
  const RmsTile tile{with_all_channels(std::move(points), schema), borders};
  const MapSchema target = schema_for_good(schema, from_pending);
  TileSettings s;
  switch (schema.promise) {
    case PromiseKind::lossless:
      s.codec = CodecId::lossless;
      return encode_tile(tile.points, schema, s);
    case PromiseKind::rms:
      return encode_for_rms(tile, target, (from_pending ? kFoldedShare : 1) * schema.promise_value);
    default:
      return encode_tile(tile.points, target, s);
  }
}

Result<EncodedTile> encode_pending(PointCloud points, const MapSchema& schema, const PendingCoding& coding) {
  MAPCODEC_ASSIGN(EncodedTile t,
                  encode_tile(with_all_channels(std::move(points), schema), coding.schema, coding.tiles));
  mark_pending(t.bytes);
  return t;
}

TileErrors joint_errors(const TileErrors& tile, const TileErrors& again, double share) {
  return {std::sqrt(tile.rms_m * tile.rms_m + share * again.rms_m * again.rms_m),
          tile.max_axis_error_m + again.max_axis_error_m, tile.color_error + share * again.color_error,
          tile.density_error + share * again.density_error};
}

Result<PendingCoding> pending_coding(const MapSchema& schema, Effort effort) {
  PendingCoding p;
  p.schema = with_color_share(schema, kPendingColor);
  p.tiles.effort = effort;
  switch (schema.promise) {
    case PromiseKind::paper:
      return make_error(
          ErrorCode::kUnsupported,
          "a map by the paper's method cannot be updated: its planes are those of a whole scan");
    case PromiseKind::lossless:
      p.tiles.codec = CodecId::lossless;
      break;
    case PromiseKind::rms:
      p.rms_m = kPendingRms * schema.promise_value;
      p.tiles.step_m = p.rms_m / kRmsOfCell;
      break;
    case PromiseKind::max_error:
      break;
  }
  return p;
}

PointCloud as_decoded(const PointCloud& points, const MapSchema& schema, const PendingCoding& coding) {
  if (coding.tiles.codec == CodecId::lossless) return without_dropped(points, schema);
  const double step_m = coding.tiles.step_m > 0 ? coding.tiles.step_m : schema.step_m;
  const Quantizer lattice{schema.origin, step_m, schema.coordinates.kind};
  PointCloud decoded;
  decoded.xyz.reserve(points.size());
  for (const Vec3& p : points.xyz) {
    Vec3& q = decoded.xyz.emplace_back();
    for (std::size_t d = 0; d < 3; ++d) q[d] = lattice.centre(lattice.lattice(p[d], d), d);
  }
  return decoded;
}

}  // namespace mapcodec
