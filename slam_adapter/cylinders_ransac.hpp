// SPDX-License-Identifier: GPL-3.0-or-later
// The door to CGAL's shape detection, with plain types only: its headers and flags stay behind it.
#pragma once

#include <cstdint>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

struct RansacSettings {
  double distance_m = 0.01;    ///< of points on a shape, at most
  double cluster_m = 0.05;     ///< points on a shape are connected over such gaps
  double normal_cosine = 0.9;  ///< between a point's normal and the shape's, at least
  std::size_t least_points = 50;
  double miss_probability = 0.01;  ///< of a shape that is there
  std::uint32_t seed = 1;
};

struct RansacCylinder {
  Vec3 on_axis{0, 0, 0};  ///< a point of the axis [m]
  Vec3 axis{0, 0, 1};     ///< unit
  double radius_m = 0;
  std::vector<std::uint32_t> points;  ///< indices of the points on it
};

/// Cylinders among oriented points by Efficient RANSAC [Schnabel, Wahl, Klein 2007], planes competing for
/// the points. The same points give the same shapes. Errors: LimitExceeded (memory), InvalidArgument (what
/// else CGAL throws). Threads: one call at a time per thread.
[[nodiscard]] Result<std::vector<RansacCylinder>> ransac_cylinders(const std::vector<Vec3>& points,
                                                                   const std::vector<Vec3>& normals,
                                                                   const RansacSettings& settings);

}  // namespace mapcodec
