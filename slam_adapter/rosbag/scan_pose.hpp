// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// A rigid motion: p -> rotation * p + translation.
struct ScanPose {
  Vec3 translation_m{0, 0, 0};
  std::array<double, 4> rotation_xyzw{0, 0, 0, 1};  ///< of length 1

  [[nodiscard]] Vec3 rotate(const Vec3& v) const;
  [[nodiscard]] Vec3 apply(const Vec3& p) const;
  [[nodiscard]] ScanPose inverse() const;
};

/// T_a_c of T_a_b and T_b_c.
[[nodiscard]] ScanPose operator*(const ScanPose& a, const ScanPose& b);
/// Between `a` (0) and `b` (1): positions on the line, rotations on the shorter arc [Shoemake 1985].
[[nodiscard]] ScanPose interpolate(const ScanPose& a, const ScanPose& b, double share);
/// Makes the quaternion one of length 1; false if it has no direction or anything is not finite.
[[nodiscard]] bool normalize(ScanPose& pose);

}  // namespace mapcodec
