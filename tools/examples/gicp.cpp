// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/examples/registration.hpp"

#ifdef MAPCODEC_PCL_REGISTRATION
#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>
#endif

namespace mapcodec::examples {

#ifdef MAPCODEC_PCL_REGISTRATION
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

/// Relative to `origin`: PCL's points are float32.
Cloud::Ptr cloud_of(const std::vector<Vec3>& points, const Vec3& origin) {
  auto r = std::make_shared<Cloud>();
  for (const Vec3& p : points)
    r->emplace_back(float(p[0] - origin[0]), float(p[1] - origin[1]), float(p[2] - origin[2]));
  return r;
}

Result<Registration> run(const std::vector<Vec3>& scan, const LocalMapView& map,
                         const Eigen::Isometry3d& guess, const RegistrationSettings& settings) {
  const std::vector<Vec3> thin = thinned(scan, settings.scan_voxel_m);
  const Eigen::Vector3d at = guess.translation();
  const Cloud::Ptr source = cloud_of(thin, {0, 0, 0});
  const Cloud::Ptr target = cloud_of(thinned(map.cloud().xyz, settings.map_voxel_m), {at[0], at[1], at[2]});
  if (source->size() < 20 || target->size() < 20)
    return make_error(ErrorCode::kEmpty, "too few points in the scan or around it");
  pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> gicp;
  gicp.setInputSource(source);
  gicp.setInputTarget(target);
  gicp.setMaxCorrespondenceDistance(settings.reach_m);
  gicp.setMaximumIterations(settings.iterations);
  gicp.setTransformationEpsilon(1e-5);
  gicp.setRotationEpsilon(1e-6);
  gicp.setTranslationGradientTolerance(1e-5);
  gicp.setRotationGradientTolerance(1e-5);
  gicp.setMaximumOptimizerIterations(50);
  Cloud moved;
  Eigen::Matrix4f begin = guess.matrix().cast<float>();
  begin.block<3, 1>(0, 3).setZero();
  gicp.align(moved, begin);
  Registration r;
  r.points = source->size();
  r.matched = source->size();
  r.converged = gicp.hasConverged();
  r.rms_m = std::sqrt(gicp.getFitnessScore(settings.reach_m));
  const Eigen::Matrix4d result = gicp.getFinalTransformation().cast<double>();
  r.T_map_scan.linear() = Eigen::Quaterniond(Eigen::Matrix3d(result.block<3, 3>(0, 0))).normalized().matrix();
  r.T_map_scan.translation() = at + result.block<3, 1>(0, 3);
  if (!r.converged || !r.T_map_scan.matrix().allFinite())
    return make_error(ErrorCode::kInvalidArgument, "GICP did not converge");
  return r;
}

}  // namespace

bool has_gicp() {
  return true;
}

Result<Registration> register_gicp(const std::vector<Vec3>& scan, const LocalMapView& map,
                                   const Eigen::Isometry3d& guess, const RegistrationSettings& settings) {
  try {
    return run(scan, map, guess, settings);
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kInvalidArgument, std::string("GICP: ") + e.what());
  }
}

#else

bool has_gicp() {
  return false;
}

Result<Registration> register_gicp(const std::vector<Vec3>&, const LocalMapView&, const Eigen::Isometry3d&,
                                   const RegistrationSettings&) {
  return make_error(ErrorCode::kUnsupported, "built without PCL's registration library");
}

#endif

}  // namespace mapcodec::examples
