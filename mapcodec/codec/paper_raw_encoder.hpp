// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/codec/paper_planes.hpp"

namespace mapcodec::paper {

/// Writes planes and points as the paper stored them: numPointsPlane, areaPlane, triangles of three float
/// vertices and one RGB each; the remaining points as floats and RGB (FORMAT.md 7.1).
/// @param color  of all points of `tile`; nullptr without colour.
[[nodiscard]] Bytes write_raw(const Extraction& extraction, const PointCloud& tile, const Channel* color,
                              const Vec3& corner, double step_m);

}  // namespace mapcodec::paper
