// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/paper_cluster.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "mapcodec/geometry/alpha_shape.hpp"

namespace mapcodec::paper {
namespace {

/// Reduced contours on the lattice; vertices that round to the same point are one.
struct Outline {
  std::vector<LatticeVertex> vertices;
  std::vector<Contour> contours;
};

Outline reduce_to_lattice(std::span<const Point2> points, const std::vector<Contour>& contours,
                          const PlaneFrame& frame, double tolerance_m) {
  Outline outline;
  std::map<std::pair<std::int64_t, std::int64_t>, std::uint32_t> index;
  for (const Contour& contour : contours) {
    const Contour reduced = reduce_contour(points, contour, tolerance_m);
    if (reduced.size() < 3) continue;
    Contour& rounded = outline.contours.emplace_back();
    for (const std::uint32_t i : reduced) {
      const LatticeVertex v = frame.to_lattice(points[i]);
      const auto [at, is_new] =
          index.try_emplace({v.u, v.v}, static_cast<std::uint32_t>(outline.vertices.size()));
      if (is_new) outline.vertices.push_back(v);
      rounded.push_back(at->second);
    }
  }
  return outline;
}

/// What the points of one triangle say about it.
struct Tally {
  std::uint32_t points = 0;
  std::array<std::uint64_t, 3> color{};
};

std::vector<Tally> tally(const PlanarTriangles& mesh, std::span<const std::array<std::uint16_t, 3>> colors,
                         std::span<const std::uint32_t> cluster) {
  std::vector<Tally> r(mesh.triangles.size());
  for (std::size_t i = 0; i < cluster.size(); ++i) {
    if (mesh.triangle_of[i] == PlanarTriangles::kOutside) continue;
    Tally& t = r[mesh.triangle_of[i]];
    ++t.points;
    for (std::size_t c = 0; c < 3 && !colors.empty(); ++c) t.color[c] += colors[cluster[i]][c];
  }
  return r;
}

double metric_area(const std::array<std::uint32_t, 3>& t, std::span<const Point2> p) {
  const Point2 &a = p[t[0]], &b = p[t[1]], &c = p[t[2]];
  return 0.5 * std::abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
}

LatticeTriangle make_triangle(const std::array<std::uint32_t, 3>& vertices, const Tally& t) {
  LatticeTriangle r{vertices, {}, t.points};
  for (std::size_t c = 0; c < 3; ++c)
    r.rgb[c] = static_cast<std::uint16_t>((t.color[c] + t.points / 2) / t.points);
  return r;
}

/// Points per square metre that a triangle outside the outline must have. With the paper's fixed threshold
/// alone, a wide triangle there is kept for the few points that the reduction cut off into it, and the
/// decoder paints empty space.
double outside_density(const PlanarTriangles& mesh, const std::vector<Tally>& tallies,
                       std::span<const Point2> metres, const PaperSettings& settings) {
  std::vector<std::pair<double, double>> by_density;  // density, points
  double points = 0;
  for (std::size_t i = 0; i < tallies.size(); ++i) {
    const double area = metric_area(mesh.triangles[i], metres);
    if (tallies[i].points == 0 || !(area > 0)) continue;
    by_density.emplace_back(tallies[i].points / area, tallies[i].points);
    points += tallies[i].points;
  }
  std::sort(by_density.begin(), by_density.end());
  double below = 0;
  for (const auto& [density, count] : by_density) {
    below += count;
    if (2 * below >= points) return std::max(settings.rel_area, settings.outside_density * density);
  }
  return settings.rel_area;
}

/// Keeps the triangles that pass the test; @return one flag per triangle.
std::vector<bool> keep_triangles(const PlanarTriangles& mesh, const std::vector<Tally>& tallies,
                                 const Outline& outline, std::span<const Point2> metres, double rel_area,
                                 double outside, LatticePlane& plane) {
  std::vector<bool> kept(mesh.triangles.size());
  const auto& at = outline.vertices;
  const auto first = static_cast<std::uint32_t>(plane.vertices.size());
  plane.vertices.insert(plane.vertices.end(), at.begin(), at.end());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const auto& t = mesh.triangles[i];
    const double points = tallies[i].points;
    // A sliver may have an area in metres and none on the lattice.
    kept[i] = points > 0 && doubled_area(at[t[0]], at[t[1]], at[t[2]]) > 0 &&
              points > (mesh.inside[i] ? rel_area : outside) * metric_area(t, metres);
    if (!kept[i]) continue;
    plane.triangles.push_back(make_triangle({t[0] + first, t[1] + first, t[2] + first}, tallies[i]));
    plane.points += tallies[i].points;
  }
  return kept;
}

}  // namespace

PlaneFrame::PlaneFrame(const Plane& plane, double step_m) : plane_(plane), step_m_(step_m) {
  for (std::uint32_t d = 0; d < 3; ++d) {
    if (std::abs(plane.normal[d]) > std::abs(plane.normal[axis_])) axis_ = d;
  }
  const Vec3& n = plane.normal;
  slope_u_ = -n[(axis_ + 1) % 3] / n[axis_];
  slope_v_ = -n[(axis_ + 2) % 3] / n[axis_];
  // Gram-Schmidt on (1, 0, slope_u) and (0, 1, slope_v).
  scale_u_ = std::sqrt(1 + slope_u_ * slope_u_);
  shear_ = slope_u_ * slope_v_ / scale_u_;
  scale_v_ = std::sqrt(1 + slope_v_ * slope_v_ - shear_ * shear_);
}

Point2 PlaneFrame::project(const Vec3& p) const {
  const double off = plane_.distance(p);
  const double u = p[(axis_ + 1) % 3] - off * plane_.normal[(axis_ + 1) % 3];
  const double v = p[(axis_ + 2) % 3] - off * plane_.normal[(axis_ + 2) % 3];
  return {u * scale_u_ + v * shear_, v * scale_v_};
}

LatticeVertex PlaneFrame::to_lattice(const Point2& p) const {
  const double v = p[1] / scale_v_;
  const double u = (p[0] - v * shear_) / scale_u_;
  return {std::llround(u / step_m_), std::llround(v / step_m_)};
}

Point2 PlaneFrame::to_metres(const LatticeVertex& at) const {
  const double u = static_cast<double>(at.u) * step_m_;
  const double v = static_cast<double>(at.v) * step_m_;
  return {u * scale_u_ + v * shear_, v * scale_v_};
}

double PlaneFrame::height(const LatticeVertex& at) const {
  return plane_.offset_m / plane_.normal[axis_] + slope_u_ * (static_cast<double>(at.u) * step_m_) +
         slope_v_ * (static_cast<double>(at.v) * step_m_);
}

Status mesh_cluster(std::span<const Vec3> xyz, std::span<const std::array<std::uint16_t, 3>> colors,
                    std::span<const std::uint32_t> cluster, const PlaneFrame& frame,
                    const PaperSettings& settings, LatticePlane& plane, std::vector<bool>& covered) {
  covered.assign(cluster.size(), false);
  if (cluster.size() < 3) return {};
  std::vector<Point2> points;
  points.reserve(cluster.size());
  for (const std::uint32_t i : cluster) points.push_back(frame.project(xyz[i]));
  MAPCODEC_ASSIGN(const std::vector<Contour> contours, find_concave_hull(points, settings.alpha_m));
  const Outline outline = reduce_to_lattice(points, contours, frame, settings.reduction_m);
  if (outline.vertices.size() < 3) return {};
  std::vector<Point2> metres;
  for (const LatticeVertex& v : outline.vertices) metres.push_back(frame.to_metres(v));
  MAPCODEC_ASSIGN(const PlanarTriangles mesh, triangulate_contours(metres, outline.contours, points));
  const std::vector<Tally> tallies = tally(mesh, colors, cluster);
  const double outside = outside_density(mesh, tallies, metres, settings);
  const std::vector<bool> kept =
      keep_triangles(mesh, tallies, outline, metres, settings.rel_area, outside, plane);
  for (std::size_t i = 0; i < cluster.size(); ++i) {
    covered[i] = mesh.triangle_of[i] != PlanarTriangles::kOutside && kept[mesh.triangle_of[i]];
  }
  return {};
}

}  // namespace mapcodec::paper
