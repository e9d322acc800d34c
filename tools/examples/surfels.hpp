// SPDX-License-Identifier: GPL-3.0-or-later
// A map as a registration wants it: one small plane per voxel, however dense the map is there.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "slam_adapter/local_map.hpp"

namespace mapcodec::examples {

/// The plane through what is around a voxel.
struct Surfel {
  Eigen::Vector3d center, normal;  ///< [m, map frame]; a unit vector whose side has no meaning
};

/// Voxel means of a map with the planes through their neighbours. A plane of many means moves far less than
/// one point when the map is coded with an error, when its points are others of the same surface, or when a
/// spinning sensor's rings are denser than they are apart. Threads: const methods from many at once.
class SurfelMap {
 public:
  /// @param points  [m, map frame] finite.
  /// @param voxel_m > 0.
  SurfelMap(const std::vector<Vec3>& points, double voxel_m);
  ~SurfelMap();
  SurfelMap(const SurfelMap&) = delete;
  SurfelMap& operator=(const SurfelMap&) = delete;

  /// The surfel nearest to `p` [m, map frame]; nullptr: none within the distance, or what is there is not
  /// flat.
  [[nodiscard]] const Surfel* nearest(const Eigen::Vector3d& p, double within_m) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The mean of the points in each voxel, in the order in which voxels were first met.
/// @param voxel_m  not positive: the points as they are.
[[nodiscard]] std::vector<Vec3> thinned(const std::vector<Vec3>& points, double voxel_m);

/// Stored patches as points on them, a grid of about `spacing_m`; a small patch is its centre. No point of
/// the map is decoded for them.
[[nodiscard]] std::vector<Vec3> points_on_patches(const LocalMapView& map, double spacing_m);

}  // namespace mapcodec::examples
