// SPDX-License-Identifier: GPL-3.0-or-later
// A piece of a plane as a map stores it: what registration and visualisation can use without drawing points.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

struct PatchTriangle {
  std::array<std::uint32_t, 3> vertices{};  ///< indices into PlanarPatch::vertices
  std::array<std::uint16_t, 3> rgb{};       ///< on the scale of the map's colour channel; 0 without colour
  std::uint32_t points = 0;                 ///< points of the map that it stands for
};

/// All points x with normal . x = offset_m that lie inside the triangles. Frame: map.
struct PlanarPatch {
  Vec3 normal{0, 0, 1};      ///< unit
  double offset_m = 0;       ///< signed distance of the plane from the map's origin
  double area_m2 = 0;        ///< of the triangles together
  std::uint64_t points = 0;  ///< of the triangles together
  std::vector<Vec3> vertices;
  std::vector<PatchTriangle> triangles;  ///< counter-clockwise or clockwise alike within a patch
};

}  // namespace mapcodec
