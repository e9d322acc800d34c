// SPDX-License-Identifier: GPL-3.0-or-later
// Weighted sums over pieces of surface, from which a plane is fitted; pieces join in constant time.
#pragma once

#include <array>
#include <cstdint>

#include "mapcodec/codec/surface_patches.hpp"

namespace mapcodec {

[[nodiscard]] inline double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
[[nodiscard]] inline Vec3 minus(const Vec3& a, const Vec3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
[[nodiscard]] inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
/// Two unit vectors that make a right-handed frame with `normal` as the third. @param normal  unit.
[[nodiscard]] std::array<Vec3, 2> plane_axes(const Vec3& normal);

/// Of points spread evenly over their patches. Exact far from the origin, too: sums are about the mean.
struct PlaneMoments {
  double weight = 0;  ///< points
  Vec3 mean{0, 0, 0};
  std::array<double, 6> scatter{};  ///< xx, xy, xz, yy, yz, zz: sum of w (x - mean)(x - mean)^T
  double noise = 0;                 ///< sum of w times the squared noise of the patches [m^2]

  PlaneMoments() = default;
  /// @param patch  with at least one point.
  explicit PlaneMoments(const SurfacePatch& patch);
  void add(const PlaneMoments& other);
  /// n^T scatter n / weight: mean squared distance from the plane through the mean [m^2].
  [[nodiscard]] double spread_along(const Vec3& n) const;
};

/// The plane through the mean that the points are nearest to.
struct FittedPlane {
  Vec3 normal{0, 0, 1};     ///< unit
  double squared = 0;       ///< mean squared distance of the points, without noise [m^2]
  double extent_m = 0;      ///< root mean square extent along the longest axis
  double least_extent = 0;  ///< along the shorter axis of the plane [m]
};
/// Eigenvectors of the scatter by Jacobi's method. Deterministic.
[[nodiscard]] FittedPlane fit_plane(const PlaneMoments& moments);

}  // namespace mapcodec
