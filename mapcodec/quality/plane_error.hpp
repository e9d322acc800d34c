// SPDX-License-Identifier: GPL-3.0-or-later
// D2: distances to the surface instead of to the points [Tian et al., ICIP 2017].
#pragma once

#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/quality/nearest.hpp"

namespace mapcodec {

/// Two clouds of finite points and their neighbourhood, both ways.
struct NeighborPair {
  const PointCloud& original;
  const PointCloud& decoded;
  const NeighborIndex& original_index;
  const Nearest& to_decoded;   ///< for each original point, the nearest decoded one
  const Nearest& to_original;  ///< for each decoded point, the nearest original one
};

/// The larger of both directions' mean squared distances along the normal [m^2]. Original points have the
/// normals of their channel "normal" (f32x3 or f64x3) or those of PCA over `knn` neighbours; a decoded point
/// has the mean normal of the original points that it is the nearest of. Threads: pure but for `runner`; the
/// same result for any split.
[[nodiscard]] double plane_mean_squared_error(const NeighborPair& pair, int knn, Runner& runner);

}  // namespace mapcodec
