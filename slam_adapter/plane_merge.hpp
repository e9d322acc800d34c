// SPDX-License-Identifier: GPL-3.0-or-later
// Patches of many cells and tiles to the planes that they are pieces of.
#pragma once

#include <span>
#include <vector>

#include "slam_adapter/plane_outline.hpp"

namespace mapcodec {

struct PlaneMergeSettings {
  /// How far patches may lie from their common plane [m], root mean square; also the scale of gaps that are
  /// bridged (twice this) and of outlines. The map's step or RMS is a good choice. > 0.
  double tolerance_m = 0.01;
  double angle_rad = 0.26;           ///< most between a patch and its plane; small patches may lean more
  std::uint64_t least_points = 100;  ///< smaller planes are left out
};

/// A plane that patches were found to lie on: all x with normal . x = offset_m.
struct MapPlane {
  Vec3 normal{0, 0, 1};  ///< unit; its greatest component is positive
  double offset_m = 0;
  Vec3 center{0, 0, 0};  ///< mean of its points
  std::uint64_t points = 0;
  double area_m2 = 0;  ///< of its patches
  double rms_m = 0;    ///< of the decoded points about it
  bool colored = false;
  std::array<double, 3> rgb{};         ///< mean, 0..255
  std::vector<PlaneOutline> outlines;  ///< the largest first
  std::vector<std::uint32_t> patches;  ///< indices of its patches, ascending
};

/// Joins patches that touch and lie on a common plane: pairs of neighbours (by a hash of their outlines) in
/// the order of how well they agree, each join tested against the plane fitted to all that it brings
/// together; O(n log n) in patches. The result depends on the patches and their order alone.
/// @return planes with enough points, most points first. Threads: pure.
[[nodiscard]] std::vector<MapPlane> merge_patches(std::span<const SurfacePatch> patches,
                                                  const PlaneMergeSettings& settings);

/// Pairs (i < j) of patches whose outlines come about `gap_m` near each other, ascending.
[[nodiscard]] std::vector<std::array<std::uint32_t, 2>> patch_neighbors(std::span<const SurfacePatch> patches,
                                                                        double gap_m);

}  // namespace mapcodec
