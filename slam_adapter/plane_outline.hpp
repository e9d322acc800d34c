// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "slam_adapter/plane_moments.hpp"

namespace mapcodec {

/// One connected piece of a plane [m, map frame], seen from where the normal points.
struct PlaneOutline {
  std::vector<Vec3> ring;                ///< counter-clockwise, closed (the last joins the first)
  std::vector<std::vector<Vec3>> holes;  ///< clockwise
  double area_m2 = 0;                    ///< holes taken away
};

/// Outlines of the union of patches seen along a plane's normal: the patches are drawn on a grid of cells of
/// `cell_m` (larger, where the plane has more than about 2^22 of them), gaps of one or two cells closed, and
/// the edges straightened by at most a cell.
/// @param center  a point of the plane; all corners given lie on it.
/// @return the largest first. Threads: pure.
[[nodiscard]] std::vector<PlaneOutline> outline_patches(std::span<const SurfacePatch> patches,
                                                        std::span<const std::uint32_t> which,
                                                        const Vec3& center, const Vec3& normal,
                                                        double cell_m);

}  // namespace mapcodec
