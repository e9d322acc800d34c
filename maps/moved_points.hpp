// SPDX-License-Identifier: GPL-3.0-or-later
// Points with what turns with them.
#pragma once

#include "mapcodec/cloud/point_cloud.hpp"
#include "maps/submap_pose.hpp"

namespace mapcodec {

/// Moves positions [m], and turns the channel "normal" (three components, f32 or f64; others stay as they
/// are). The identity changes no bit. Coordinates keep their format: what a file of floats held is, moved, no
/// longer what it could hold. Threads: pure.
void move_points(PointCloud& cloud, const RigidMotion& motion);

}  // namespace mapcodec
