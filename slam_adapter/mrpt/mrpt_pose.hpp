// SPDX-License-Identifier: GPL-3.0-or-later
// MRPT's poses and ours.
#pragma once

#include <mrpt/poses/CPose3D.h>
#include <mrpt/poses/CPose3DQuat.h>

#include "slam_adapter/local_map.hpp"

namespace mapcodec {

[[nodiscard]] inline MapPose pose_of(const mrpt::poses::CPose3D& p) {
  const mrpt::poses::CPose3DQuat q(p);
  return {{p.x(), p.y(), p.z()}, {q.quat().x(), q.quat().y(), q.quat().z(), q.quat().r()}};
}

[[nodiscard]] inline mrpt::poses::CPose3D mrpt_pose(const MapPose& p) {
  const auto& [x, y, z, w] = p.rotation_xyzw;
  return mrpt::poses::CPose3D(mrpt::poses::CPose3DQuat(
      p.translation_m[0], p.translation_m[1], p.translation_m[2], mrpt::math::CQuaternionDouble(w, x, y, z)));
}

}  // namespace mapcodec
