// SPDX-License-Identifier: GPL-3.0-or-later
// One coloured plane: outline, triangles and their points (steps 5 and 6 of Algorithm 1).
#pragma once

#include <span>

#include "mapcodec/base/result.hpp"
#include "mapcodec/codec/paper_mesh.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/contour_reduction.hpp"
#include "mapcodec/geometry/plane_ransac.hpp"

namespace mapcodec::paper {

/// Coordinates in a plane. The lattice counts along the two axes that are not dominant; metres are along two
/// orthogonal directions of the plane itself, turning the same way.
class PlaneFrame {
 public:
  PlaneFrame(const Plane& plane, double step_m);

  [[nodiscard]] std::uint32_t axis() const { return axis_; }
  /// Foot of the perpendicular from `p` [m, in the plane].
  [[nodiscard]] Point2 project(const Vec3& p) const;
  [[nodiscard]] LatticeVertex to_lattice(const Point2& p) const;
  [[nodiscard]] Point2 to_metres(const LatticeVertex& v) const;
  /// Height [m] of the plane along its dominant axis above a lattice point.
  [[nodiscard]] double height(const LatticeVertex& v) const;

 private:
  Plane plane_;
  double step_m_;
  std::uint32_t axis_ = 2;
  double slope_u_ = 0, slope_v_ = 0;  ///< rise of the dominant coordinate
  double scale_u_ = 1;                ///< length of the direction that u alone runs along
  double shear_ = 0, scale_v_ = 1;    ///< metres of v along that direction and across it
};

/// Appends the kept triangles of one cluster to `plane`, vertices too.
/// @param covered  one flag per entry of `cluster`: whether a kept triangle stands for the point.
/// Errors: InvalidArgument. Threads: pure.
[[nodiscard]] Status mesh_cluster(std::span<const Vec3> xyz,
                                  std::span<const std::array<std::uint16_t, 3>> colors,
                                  std::span<const std::uint32_t> cluster, const PlaneFrame& frame,
                                  const PaperSettings& settings, LatticePlane& plane,
                                  std::vector<bool>& covered);

}  // namespace mapcodec::paper
