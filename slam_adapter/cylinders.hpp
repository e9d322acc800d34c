// SPDX-License-Identifier: GPL-3.0-or-later
// Cylinders that describe a map's surfaces better than planes do.
#pragma once

#include <span>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "slam_adapter/plane_merge.hpp"

namespace mapcodec {

struct CylinderSettings {
  double tolerance_m = 0.01;  ///< as in PlaneMergeSettings
  double most_radius_m = 2;
  double least_arc_rad = 1.2;  ///< of its circle that is seen
  std::uint64_t least_points = 100;
};

struct MapCylinder {
  Vec3 center{0, 0, 0};  ///< middle of the axis
  Vec3 axis{0, 0, 1};    ///< unit; its greatest component is positive
  double radius_m = 0;
  double length_m = 0;  ///< along the axis, half to each side of the centre
  double arc_rad = 0;   ///< of the circle that has surface
  std::uint64_t points = 0;
  double rms_m = 0;          ///< of the decoded points about it
  double planes_rms_m = 0;   ///< of the same points about the planes that it replaces
  std::uint32_t planes = 0;  ///< how many planes (or single patches) it replaces
  bool colored = false;
  std::array<double, 3> rgb{};         ///< mean, 0..255
  std::vector<std::uint32_t> patches;  ///< indices, ascending
};

/// Cylinders by Efficient RANSAC over samples of the patches, of which those are kept that describe their
/// points with a lower RMS than the planes do, or with clearly fewer primitives (a third at most) at nearly
/// the same RMS. Deterministic.
/// @param planes  as merge_patches gave them for the same patches.
/// @return most points first; no patch is on two. Errors: Unsupported (built without CGAL), LimitExceeded.
[[nodiscard]] Result<std::vector<MapCylinder>> find_cylinders(std::span<const SurfacePatch> patches,
                                                              std::span<const MapPlane> planes,
                                                              const CylinderSettings& settings);

}  // namespace mapcodec
