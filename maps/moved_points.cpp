// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/moved_points.hpp"

namespace mapcodec {
namespace {

template <class Scalar>
void turn(Channel& normals, const RigidMotion& motion) {
  for (std::size_t i = 0; i < normals.size(); ++i) {
    Vec3 n;
    for (std::size_t d = 0; d < 3; ++d) n[d] = double(normals.get<Scalar>(i, d));
    n = motion.rotate(n);
    for (std::size_t d = 0; d < 3; ++d) normals.set(i, static_cast<Scalar>(n[d]), d);
  }
}

}  // namespace

void move_points(PointCloud& cloud, const RigidMotion& motion) {
  if (motion.is_identity()) return;
  for (Vec3& p : cloud.xyz) p = motion.apply(p);
  Channel* normals = cloud.find("normal");
  if (normals == nullptr || normals->info.components != 3) return;
  if (normals->info.scalar == ScalarType::f32) turn<float>(*normals, motion);
  if (normals->info.scalar == ScalarType::f64) turn<double>(*normals, motion);
}

}  // namespace mapcodec
