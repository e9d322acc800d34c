// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/paper_raw_encoder.hpp"

#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/geometry/triangle_sampler.hpp"

namespace mapcodec::paper {
namespace {

/// Relative to the corner.
Vec3 lift(const LatticePlane& plane, std::uint32_t vertex, double step_m) {
  const LatticeVertex& p = plane.vertices[vertex];
  const auto share = [](std::int64_t from, std::int64_t to, std::int64_t span) {
    return span > 0 ? static_cast<double>(to - from) / static_cast<double>(span) : 0;
  };
  const double rise = share(plane.low.u, p.u, plane.span.u) * static_cast<double>(plane.heights[1]) +
                      share(plane.low.v, p.v, plane.span.v) * static_cast<double>(plane.heights[2]);
  Vec3 r{};
  r[plane.axis] = (static_cast<double>(plane.heights[0]) + rise) * (step_m / kHeightsPerStep);
  r[(plane.axis + 1) % 3] = static_cast<double>(p.u) * step_m;
  r[(plane.axis + 2) % 3] = static_cast<double>(p.v) * step_m;
  return r;
}

void write_position(ByteWriter& out, const Vec3& p) {
  for (const double x : p) out.f32(static_cast<float>(x));
}

void write_triangle(ByteWriter& out, const std::array<Vec3, 3>& corners,
                    const std::array<std::uint16_t, 3>& rgb, const Channel* color) {
  for (const Vec3& p : corners) write_position(out, p);
  for (std::size_t c = 0; c < 3 && color != nullptr; ++c) {
    if (color->info.scalar == ScalarType::u8) {
      out.u8(static_cast<std::uint8_t>(rgb[c]));
    } else {
      out.u16(rgb[c]);
    }
  }
}

void write_plane(ByteWriter& out, const LatticePlane& plane, const Channel* color, double step_m) {
  std::vector<std::array<Vec3, 3>> corners;
  double area = 0;
  for (const LatticeTriangle& t : plane.triangles) {
    const auto& v = t.vertices;
    corners.push_back({lift(plane, v[0], step_m), lift(plane, v[1], step_m), lift(plane, v[2], step_m)});
    area += triangle_area(corners.back()[0], corners.back()[1], corners.back()[2]);
  }
  out.u32(static_cast<std::uint32_t>(plane.points));
  out.f32(static_cast<float>(area));
  out.u32(static_cast<std::uint32_t>(plane.triangles.size()));
  for (std::size_t i = 0; i < corners.size(); ++i)
    write_triangle(out, corners[i], plane.triangles[i].rgb, color);
}

}  // namespace

Bytes write_raw(const Extraction& extraction, const PointCloud& tile, const Channel* color,
                const Vec3& corner, double step_m) {
  ByteWriter out;
  for (const double x : corner) out.f64(x);
  out.u32(static_cast<std::uint32_t>(extraction.planes.size()));
  for (const LatticePlane& plane : extraction.planes) write_plane(out, plane, color, step_m);
  out.u32(static_cast<std::uint32_t>(extraction.leftovers.size()));
  for (const std::uint32_t i : extraction.leftovers) {
    const Vec3& p = tile.xyz[i];
    write_position(out, {p[0] - corner[0], p[1] - corner[1], p[2] - corner[2]});
    if (color != nullptr) out.raw({color->at(i), color->info.stride()});
  }
  return out.take();
}

}  // namespace mapcodec::paper
