// SPDX-License-Identifier: GPL-3.0-or-later
// What rigid motions do with each other. Quaternions are x, y, z, w and of length 1.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "slam_adapter/local_map.hpp"

namespace mapcodec {

using Quaternion = std::array<double, 4>;

[[nodiscard]] inline Quaternion normalized(Quaternion q) {
  const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& v : q) v /= n;
  return q;
}

[[nodiscard]] inline Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
          a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
          a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

[[nodiscard]] inline Quaternion conjugate(const Quaternion& q) {
  return {-q[0], -q[1], -q[2], q[3]};
}

[[nodiscard]] inline Vec3 rotated(const Quaternion& q, const Vec3& p) {
  const Quaternion r = product(product(q, {p[0], p[1], p[2], 0}), conjugate(q));
  return {r[0], r[1], r[2]};
}

[[nodiscard]] inline Vec3 transformed(const MapPose& T, const Vec3& p) {
  const Vec3 r = rotated(T.rotation_xyzw, p);
  return {r[0] + T.translation_m[0], r[1] + T.translation_m[1], r[2] + T.translation_m[2]};
}

/// T_a_c of T_a_b and T_b_c.
[[nodiscard]] inline MapPose compose(const MapPose& ab, const MapPose& bc) {
  return {transformed(ab, bc.translation_m), normalized(product(ab.rotation_xyzw, bc.rotation_xyzw))};
}

[[nodiscard]] inline MapPose inverse(const MapPose& T) {
  const Quaternion q = conjugate(T.rotation_xyzw);
  const Vec3 t = rotated(q, T.translation_m);
  return {{-t[0], -t[1], -t[2]}, q};
}

/// T_a_b of T_m_a and T_m_b.
[[nodiscard]] inline MapPose between(const MapPose& a, const MapPose& b) {
  return compose(inverse(a), b);
}

[[nodiscard]] inline double length_of(const Vec3& t) {
  return std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
}

/// Angle of the rotation [rad, 0 to pi].
[[nodiscard]] inline double angle_of(const Quaternion& q) {
  return 2 * std::atan2(length_of({q[0], q[1], q[2]}), std::abs(q[3]));
}

/// Between a (share 0) and b (share 1): straight, and turning evenly (Shoemake 1985).
[[nodiscard]] inline MapPose interpolated(const MapPose& a, const MapPose& b, double share) {
  MapPose r;
  for (std::size_t d = 0; d < 3; ++d)
    r.translation_m[d] = a.translation_m[d] + share * (b.translation_m[d] - a.translation_m[d]);
  Quaternion to = b.rotation_xyzw;
  double cosine = 0;
  for (std::size_t d = 0; d < 4; ++d) cosine += a.rotation_xyzw[d] * to[d];
  if (cosine < 0) {
    for (double& v : to) v = -v;
    cosine = -cosine;
  }
  const double angle = std::acos(std::min(1.0, cosine));
  const bool near = angle < 1e-6;
  const double wa = near ? 1 - share : std::sin((1 - share) * angle) / std::sin(angle);
  const double wb = near ? share : std::sin(share * angle) / std::sin(angle);
  for (std::size_t d = 0; d < 4; ++d) r.rotation_xyzw[d] = wa * a.rotation_xyzw[d] + wb * to[d];
  r.rotation_xyzw = normalized(r.rotation_xyzw);
  return r;
}

}  // namespace mapcodec
