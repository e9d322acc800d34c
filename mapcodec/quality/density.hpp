// SPDX-License-Identifier: GPL-3.0-or-later
// How far the number of points per voxel has changed.
#pragma once

#include <cstdint>
#include <span>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// Sum of |n_decoded - n_original| over cubic voxels, divided by the number of original points: 0 where every
/// voxel keeps its count, 2 where as many points all went elsewhere. The mean over `shifts` grids, each moved
/// by voxel_m / shifts on all axes, so that a wall on a voxel's face does not count as an error. Non-finite
/// points are left out. Fast where neighbouring points stand near each other in the arrays. NaN if `original`
/// has no finite point.
/// @param voxel_m  side of a voxel [m], > 0.
/// @param shifts   number of grids, >= 1.
/// Threads: pure.
[[nodiscard]] double density_error(std::span<const Vec3> original, std::span<const Vec3> decoded,
                                   double voxel_m = 0.1, int shifts = 4);

/// The same over four grids, several times faster, where it is known which point became which: most stay in
/// their voxels.
/// @param order  decoded point i comes from original order[i]; a permutation, so that no point is lost.
[[nodiscard]] double density_error_of_moved(std::span<const Vec3> original, std::span<const Vec3> decoded,
                                            std::span<const std::uint32_t> order, double voxel_m = 0.1);

/// One of the grids above: sum |n_decoded - n_original| over voxels whose grid is moved by `offset_m` on all
/// axes.
[[nodiscard]] double density_difference(std::span<const Vec3> original, std::span<const Vec3> decoded,
                                        double voxel_m, double offset_m);

}  // namespace mapcodec
