// SPDX-License-Identifier: GPL-3.0-or-later
// The largest plane of a cloud by RANSAC [Fischler, Bolles 1981], through PCL.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// normal . x = offset
struct Plane {
  Vec3 normal{0, 0, 1};  ///< unit; its largest component is positive
  double offset_m = 0;

  [[nodiscard]] double distance(const Vec3& p) const {
    return normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2] - offset_m;
  }
};

/// Finds the plane that most of `remaining` are near to: RANSAC (probability 0.99) scored on at most 2000
/// evenly taken points, then a least-squares plane through all its inliers. Deterministic.
/// @param xyz        [m], relative to a corner nearby: PCL works in float32.
/// @param remaining  indices into xyz that take part.
/// @return nothing where no three points span a plane. Threads: pure.
[[nodiscard]] std::optional<Plane> find_largest_plane(std::span<const Vec3> xyz,
                                                      std::span<const std::uint32_t> remaining,
                                                      double distance_m);

}  // namespace mapcodec
