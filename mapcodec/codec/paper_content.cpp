// SPDX-License-Identifier: GPL-3.0-or-later
// The entropy-coded form, and the door to both.
#include "mapcodec/codec/paper_content.hpp"

#include <cmath>

#include "mapcodec/attribute/channel_decoder.hpp"
#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/codec/paper_mesh_decoder.hpp"
#include "mapcodec/codec/paper_sections.hpp"
#include "mapcodec/codec/points_decoder.hpp"
#include "mapcodec/geometry/triangle_sampler.hpp"

namespace mapcodec::paper {
namespace {

struct PlaneScale {
  Vec3 corner{};
  double step_m = 0;
  std::uint32_t color_step = 0;
};

Error malformed(const char* what, std::size_t at) {
  return make_error(ErrorCode::kMalformed, std::string("paper: ") + what, at);
}

/// Point of the plane above lattice point `p`.
Vec3 lift(const LatticePlane& plane, const LatticeVertex& p, const PlaneScale& scale) {
  const double along_u = static_cast<double>(p.u - plane.low.u) / static_cast<double>(plane.span.u);
  const double along_v = static_cast<double>(p.v - plane.low.v) / static_cast<double>(plane.span.v);
  const double rise_u = along_u * static_cast<double>(plane.heights[1]);
  const double rise_v = along_v * static_cast<double>(plane.heights[2]);
  const double height =
      (static_cast<double>(plane.heights[0]) + rise_u + rise_v) * (scale.step_m / kHeightsPerStep);
  const std::size_t k = plane.axis;
  Vec3 r = scale.corner;
  r[k] += height;
  r[(k + 1) % 3] += static_cast<double>(p.u) * scale.step_m;
  r[(k + 2) % 3] += static_cast<double>(p.v) * scale.step_m;
  return r;
}

PlanarPatch to_patch(const LatticePlane& plane, const PlaneScale& scale) {
  PlanarPatch patch;
  patch.points = plane.points;
  patch.vertices.reserve(plane.vertices.size());
  for (const LatticeVertex& v : plane.vertices) patch.vertices.push_back(lift(plane, v, scale));
  patch.triangles.reserve(plane.triangles.size());
  for (const LatticeTriangle& t : plane.triangles) patch.triangles.push_back({t.vertices, t.rgb, t.points});
  complete_patch(patch);
  return patch;
}

Result<PlaneScale> read_scale(ByteReader& in, const MapSchema& schema, std::uint32_t most_color) {
  PlaneScale scale;
  for (std::size_t d = 0; d < 3; ++d)
    scale.corner[d] = schema.origin[d] + static_cast<double>(in.signed_varint());
  scale.step_m = static_cast<double>(in.f32());
  const std::uint64_t color_step = most_color > 0 ? in.varint() : 0;
  MAPCODEC_TRY(in.status("paper: plane header"));
  if (!(scale.step_m > 0) || !std::isfinite(scale.step_m))
    return malformed("vertex step is not positive", in.offset());
  if (color_step > most_color || (most_color > 0 && color_step == 0))
    return malformed("bad colour step", in.offset());
  scale.color_step = static_cast<std::uint32_t>(color_step);
  return scale;
}

/// @return points of the planes.
Result<std::uint64_t> read_planes(ByteReader& in, std::uint64_t count, const MapSchema& schema,
                                  const DecodeLimits& limits, Content& content) {
  const std::uint64_t planes = in.varint();
  MAPCODEC_TRY(in.status("paper: number of planes"));
  if (planes > count) return malformed("more planes than points", in.offset());
  if (planes == 0) return std::uint64_t{0};
  const std::size_t color = color_channel(schema);
  const std::uint32_t most_color = color == kNoColor ? 0 : max_color(schema.channels[color].info);
  MAPCODEC_ASSIGN(const PlaneScale scale, read_scale(in, schema, most_color));
  const ByteSpan stream = in.sized();
  MAPCODEC_TRY(in.status("paper: planes"));
  MAPCODEC_ASSIGN(const auto lattice,
                  decode_planes(stream, planes, count, limits.max_bytes, scale.color_step, most_color));
  std::uint64_t points = 0;
  for (const LatticePlane& plane : lattice) {
    content.patches.push_back(to_patch(plane, scale));
    points += plane.points;
  }
  return points;
}

Status read_rest(ByteReader& in, std::uint64_t points, const MapSchema& schema, const DecodeLimits& limits,
                 Content& content) {
  if (points == 0) return in.left() == 0 ? Status() : malformed("bytes after the end", in.offset());
  const std::size_t color = color_channel(schema);
  const double step_m = in.f64();
  const ByteSpan geometry = color == kNoColor ? in.raw(in.left()) : in.sized();
  MAPCODEC_TRY(in.status("paper: remaining points"));
  if (!(step_m > 0) || !std::isfinite(step_m)) return malformed("voxel step is not positive", in.offset());
  const Quantizer lattice{schema.origin, step_m, schema.coordinates.kind};
  MAPCODEC_ASSIGN(DecodedPoints rest, decode_points(geometry, points, lattice, limits));
  if (rest.xyz.size() != points)
    return malformed("remaining points are not as many as announced", in.offset());
  content.rest = std::move(rest.xyz);
  if (color == kNoColor) return {};
  MAPCODEC_ASSIGN(Channel values,
                  decode_channel(in.raw(in.left()), schema.channels[color], rest.voxels, limits));
  content.rest_color = std::move(values.data);
  return {};
}

Status check_request(std::uint64_t count, const MapSchema& schema, const DecodeLimits& limits) {
  if (!can_keep(schema)) {
    return make_error(ErrorCode::kInvalidArgument, "the paper's method keeps no channel but colour");
  }
  if (count > limits.max_points || count > 0xffffffffu || count > limits.max_bytes / sizeof(Vec3)) {
    return make_error(ErrorCode::kLimitExceeded,
                      "paper: tile announces " + std::to_string(count) + " points");
  }
  return {};
}

}  // namespace

void complete_patch(PlanarPatch& patch) {
  Vec3 sum{};
  for (const PatchTriangle& t : patch.triangles) {
    const Vec3 &a = patch.vertices[t.vertices[0]], &b = patch.vertices[t.vertices[1]],
               &c = patch.vertices[t.vertices[2]];
    for (std::size_t d = 0; d < 3; ++d) {
      const std::size_t i = (d + 1) % 3, j = (d + 2) % 3;
      sum[d] += (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i]);
    }
    patch.area_m2 += triangle_area(a, b, c);
  }
  const double length = std::sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
  if (length > 0 && std::isfinite(length)) patch.normal = {sum[0] / length, sum[1] / length, sum[2] / length};
  const Vec3& a = patch.vertices[patch.triangles[0].vertices[0]];
  patch.offset_m = patch.normal[0] * a[0] + patch.normal[1] * a[1] + patch.normal[2] * a[2];
}

Result<Content> read_content(ByteSpan bytes, std::uint64_t count, const MapSchema& schema,
                             const DecodeLimits& limits, bool with_rest) {
  MAPCODEC_TRY(check_request(count, schema, limits));
  ByteReader in(bytes);
  const std::uint8_t form = in.u8();
  MAPCODEC_TRY(in.status("paper: form"));
  if ((form & ~(kFormRaw | kFormColor)) != 0) return malformed("unknown form", 0);
  if (((form & kFormColor) != 0) != (color_channel(schema) != kNoColor)) {
    return malformed("colour where the schema has none, or none where it has", 0);
  }
  if ((form & kFormRaw) != 0) return read_raw_content(in.raw(in.left()), count, schema);
  Content content;
  MAPCODEC_ASSIGN(const std::uint64_t on_planes, read_planes(in, count, schema, limits, content));
  if (with_rest) MAPCODEC_TRY(read_rest(in, count - on_planes, schema, limits, content));
  return content;
}

}  // namespace mapcodec::paper
