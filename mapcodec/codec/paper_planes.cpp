// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/paper_planes.hpp"

#include <algorithm>
#include <cmath>

#include "mapcodec/codec/paper_cluster.hpp"
#include "mapcodec/geometry/kmeans.hpp"
#include "mapcodec/geometry/outlier_filter.hpp"
#include "mapcodec/geometry/plane_ransac.hpp"

namespace mapcodec::paper {
namespace {

using Color = std::array<std::uint16_t, 3>;
using Indices = std::vector<std::uint32_t>;

class PlaneExtractor {
 public:
  PlaneExtractor(std::span<const Vec3> xyz, std::span<const Color> colors, const PaperSettings& settings,
                 double step_m)
      : xyz_(xyz), colors_(colors), settings_(settings), step_m_(step_m), remaining_(xyz.size()) {
    for (std::uint32_t i = 0; i < remaining_.size(); ++i) remaining_[i] = i;
  }

  Result<Extraction> run() {
    const double enough = settings_.perc_process * static_cast<double>(xyz_.size());
    while (static_cast<double>(remaining_.size()) > enough) {
      const std::optional<Plane> plane = find_largest_plane(xyz_, remaining_, settings_.distance_m);
      if (!plane) break;
      const Indices inliers = take_inliers(*plane);
      if (inliers.empty()) break;
      MAPCODEC_TRY(add_plane(*plane, keep_supported(inliers)));
    }
    leave(remaining_);
    std::sort(result_.leftovers.begin(), result_.leftovers.end());
    return std::move(result_);
  }

 private:
  void leave(const Indices& points) {
    result_.leftovers.insert(result_.leftovers.end(), points.begin(), points.end());
  }

  /// Moves the plane's points out of `remaining_`; none, and no change, if they are fewer than the smallest
  /// plane.
  Indices take_inliers(const Plane& plane) {
    Indices inliers, others;
    for (const std::uint32_t i : remaining_) {
      const bool near = std::abs(plane.distance(xyz_[i])) <= settings_.distance_m;
      (near ? inliers : others).push_back(i);
    }
    if (inliers.size() < std::max<std::size_t>(settings_.min_points, 3)) return {};
    remaining_.swap(others);
    return inliers;
  }

  /// Isolated points are not compressed.
  Indices keep_supported(const Indices& inliers) {
    const auto supported =
        find_supported_points(xyz_, inliers, settings_.outlier_k, settings_.outlier_radius_m);
    Indices kept;
    for (std::size_t i = 0; i < inliers.size(); ++i)
      (supported[i] ? kept : result_.leftovers).push_back(inliers[i]);
    return kept;
  }

  [[nodiscard]] std::vector<Indices> split_by_color(const Indices& points) const {
    if (colors_.empty() || settings_.clusters < 2) return {points};
    std::vector<Color> colors;
    colors.reserve(points.size());
    for (const std::uint32_t i : points) colors.push_back(colors_[i]);
    const std::vector<std::uint32_t> cluster = cluster_colors(colors, settings_.clusters);
    std::vector<Indices> r(settings_.clusters);
    for (std::size_t i = 0; i < points.size(); ++i) r[cluster[i]].push_back(points[i]);
    return r;
  }

  /// The raw form shares a plane's points by area alone, so each cluster ("coloured plane") is a plane of its
  /// own there: else the triangles of a sparse colour would take the points of a dense one below them. The
  /// coded form keeps a density per triangle, and its clusters are one plane.
  Status add_plane(const Plane& plane, const Indices& points) {
    const PlaneFrame frame(plane, step_m_);
    LatticePlane lattice;
    for (const Indices& cluster : split_by_color(points)) {
      MAPCODEC_TRY(add_cluster(frame, cluster, lattice));
      if (settings_.raw) keep(frame, lattice);
    }
    keep(frame, lattice);
    return {};
  }
  Status add_cluster(const PlaneFrame& frame, const Indices& cluster, LatticePlane& plane) {
    std::vector<bool> covered;
    MAPCODEC_TRY(mesh_cluster(xyz_, colors_, cluster, frame, settings_, plane, covered));
    for (std::size_t i = 0; i < cluster.size(); ++i) {
      if (!covered[i]) result_.leftovers.push_back(cluster[i]);
    }
    return {};
  }
  /// Moves the plane, if it has triangles, into the result; `plane` is empty then.
  void keep(const PlaneFrame& frame, LatticePlane& plane) {
    if (!plane.triangles.empty()) {
      plane.axis = frame.axis();
      place(frame, plane);
      result_.planes.push_back(std::move(plane));
    }
    plane = LatticePlane{};
  }

  /// Bounding box and heights of a plane whose triangles are there.
  void place(const PlaneFrame& frame, LatticePlane& plane) const {
    LatticeVertex low = plane.vertices[plane.triangles[0].vertices[0]], high = low;
    for (const LatticeTriangle& t : plane.triangles) {
      for (const std::uint32_t i : t.vertices) {
        const LatticeVertex& v = plane.vertices[i];
        low = {std::min(low.u, v.u), std::min(low.v, v.v)};
        high = {std::max(high.u, v.u), std::max(high.v, v.v)};
      }
    }
    plane.low = low;
    plane.span = {high.u - low.u, high.v - low.v};
    const double base = frame.height(low);
    const double rise_u = frame.height({high.u, low.v}) - base;
    const double rise_v = frame.height({low.u, high.v}) - base;
    const double unit = kHeightsPerStep / step_m_;
    plane.heights = {std::llround(base * unit), std::llround(rise_u * unit), std::llround(rise_v * unit)};
  }

  std::span<const Vec3> xyz_;
  std::span<const Color> colors_;
  const PaperSettings& settings_;
  double step_m_;
  Indices remaining_;
  Extraction result_;
};

}  // namespace

Result<Extraction> extract_planes(std::span<const Vec3> xyz, std::span<const Color> colors,
                                  const PaperSettings& settings, double step_m) {
  return PlaneExtractor(xyz, colors, settings, step_m).run();
}

}  // namespace mapcodec::paper
