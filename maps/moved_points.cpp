// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/moved_points.hpp"

#include "mapcodec/cloud/normals.hpp"

namespace mapcodec {

void move_points(PointCloud& cloud, const RigidMotion& motion) {
  if (motion.is_identity()) return;
  for (Vec3& p : cloud.xyz) p = motion.apply(p);
  turn_normals(cloud, [&](const Vec3& n) { return motion.rotate(n); });
}

}  // namespace mapcodec
