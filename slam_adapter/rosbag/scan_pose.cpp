// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/scan_pose.hpp"

#include <cmath>

namespace mapcodec {
namespace {

using Quaternion = std::array<double, 4>;  // x, y, z, w

Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Quaternion& a, const Quaternion& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

Quaternion scaled(const Quaternion& q, double s) {
  return {q[0] * s, q[1] * s, q[2] * s, q[3] * s};
}

Quaternion weighted(const Quaternion& a, double wa, const Quaternion& b, double wb) {
  Quaternion r;
  for (std::size_t i = 0; i < 4; ++i) r[i] = wa * a[i] + wb * b[i];
  return scaled(r, 1 / std::sqrt(dot(r, r)));
}

}  // namespace

Vec3 ScanPose::rotate(const Vec3& v) const {
  const Vec3 u{rotation_xyzw[0], rotation_xyzw[1], rotation_xyzw[2]};
  const Vec3 t = cross(u, v);
  const Vec3 c = cross(u, t);
  Vec3 r;
  for (std::size_t d = 0; d < 3; ++d) r[d] = v[d] + 2 * (rotation_xyzw[3] * t[d] + c[d]);
  return r;
}

Vec3 ScanPose::apply(const Vec3& p) const {
  const Vec3 r = rotate(p);
  return {r[0] + translation_m[0], r[1] + translation_m[1], r[2] + translation_m[2]};
}

ScanPose ScanPose::inverse() const {
  ScanPose r;
  r.rotation_xyzw = {-rotation_xyzw[0], -rotation_xyzw[1], -rotation_xyzw[2], rotation_xyzw[3]};
  const Vec3 t = r.rotate(translation_m);
  r.translation_m = {-t[0], -t[1], -t[2]};
  return r;
}

ScanPose operator*(const ScanPose& a, const ScanPose& b) {
  const Quaternion &p = a.rotation_xyzw, &q = b.rotation_xyzw;
  ScanPose r;
  r.rotation_xyzw = {p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1],
                     p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0],
                     p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3],
                     p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]};
  r.translation_m = a.apply(b.translation_m);
  (void)normalize(r);  // keeps long chains from drifting off length 1
  return r;
}

ScanPose interpolate(const ScanPose& a, const ScanPose& b, double share) {
  ScanPose r;
  for (std::size_t d = 0; d < 3; ++d)
    r.translation_m[d] = a.translation_m[d] + share * (b.translation_m[d] - a.translation_m[d]);
  const double cosine = dot(a.rotation_xyzw, b.rotation_xyzw);
  const Quaternion to = cosine < 0 ? scaled(b.rotation_xyzw, -1) : b.rotation_xyzw;
  const double c = std::fabs(cosine);
  if (c > 1 - 1e-9) {  // the arc's formula divides by its sine
    r.rotation_xyzw = weighted(a.rotation_xyzw, 1 - share, to, share);
    return r;
  }
  const double angle = std::acos(c);
  r.rotation_xyzw = weighted(a.rotation_xyzw, std::sin((1 - share) * angle), to, std::sin(share * angle));
  return r;
}

bool normalize(ScanPose& pose) {
  const double length = std::sqrt(dot(pose.rotation_xyzw, pose.rotation_xyzw));
  if (!std::isfinite(length) || length < 1e-6 || !is_finite(pose.translation_m)) return false;
  pose.rotation_xyzw = scaled(pose.rotation_xyzw, 1 / length);
  return true;
}

}  // namespace mapcodec
