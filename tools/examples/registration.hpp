// SPDX-License-Identifier: GPL-3.0-or-later
// Where a scan was taken, from the map around: four ways, for `localize` and `mapcodec bench local`.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "tools/examples/surfels.hpp"

namespace mapcodec::examples {

struct RegistrationSettings {
  double reach_m = 1.0;  ///< largest error of the guess, about: how far partners are looked for at first
  double scan_voxel_m = 0.10;  ///< the scan is thinned to one point per voxel of this side; 0: not at all
  double map_voxel_m = 0.10;   ///< as the map is, to voxel means: > 0
  double ndt_cell_m = 1.0;     ///< side of a normal distribution of NDT
  int iterations = 100;        ///< most of them
  double step_m = 5e-5;        ///< ends when a step moves the scan by less than this ...
  double step_rad = 1e-5;      ///< ... and turns it by less
};

struct Registration {
  Eigen::Isometry3d T_map_scan = Eigen::Isometry3d::Identity();
  double rms_m = 0;         ///< of the distances of matched points
  std::size_t points = 0;   ///< of the thinned scan
  std::size_t matched = 0;  ///< of them, those that count
  int iterations = 0;
  bool converged = false;
};

/// What a point is matched with.
enum class Partner {
  patches,  ///< planes through stored surfaces (LocalContent::patches): no map point is decoded for it
  points,   ///< planes through the map's points (LocalContent::points)
};

/// Point-to-plane ICP [Chen & Medioni 1992] by Gauss-Newton with a Geman-McClure kernel whose width follows
/// the residuals.
/// @param scan   finite points [m, scan frame].
/// @param guess  T_map_scan, within reach_m of the truth.
/// Errors: Empty (no point, or too few partners), InvalidArgument (the planes leave a direction free).
/// Threads: pure.
[[nodiscard]] Result<Registration> register_to_planes(const std::vector<Vec3>& scan, const LocalMapView& map,
                                                      const Eigen::Isometry3d& guess, Partner partner,
                                                      const RegistrationSettings& settings = {});

/// PCL's generalized ICP [Segal et al. 2009] on the map's points.
/// Errors: Empty; InvalidArgument (PCL gave up); Unsupported (built without PCL's registration).
[[nodiscard]] Result<Registration> register_gicp(const std::vector<Vec3>& scan, const LocalMapView& map,
                                                 const Eigen::Isometry3d& guess,
                                                 const RegistrationSettings& settings = {});
/// PCL's normal distributions transform [Magnusson 2009; Biber & Strasser 2003] on the map's points.
/// Errors: as register_gicp.
[[nodiscard]] Result<Registration> register_ndt(const std::vector<Vec3>& scan, const LocalMapView& map,
                                                const Eigen::Isometry3d& guess,
                                                const RegistrationSettings& settings = {});
/// Whether register_gicp and register_ndt were built.
[[nodiscard]] bool has_pcl();

[[nodiscard]] Eigen::Isometry3d to_isometry(const MapPose& p);
[[nodiscard]] MapPose to_pose(const Eigen::Isometry3d& t);
/// [mm] between the origins, [mrad] of the rotation between them.
struct PoseDifference {
  double mm = 0, mrad = 0;
};
[[nodiscard]] PoseDifference difference(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b);

}  // namespace mapcodec::examples
