// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/examples/registration.hpp"

#ifdef MAPCODEC_PCL_REGISTRATION
#include <pcl/point_types.h>
#include <pcl/registration/gicp.h>
#include <pcl/registration/ndt.h>
#endif

namespace mapcodec::examples {

#ifdef MAPCODEC_PCL_REGISTRATION
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Method = pcl::Registration<pcl::PointXYZ, pcl::PointXYZ>;

/// The last stage of GICP has partners within so many voxels.
constexpr double kFineReach = 3;

/// Relative to `origin`: PCL's points are float32.
Cloud::Ptr cloud_of(const std::vector<Vec3>& points, const Vec3& origin) {
  auto r = std::make_shared<Cloud>();
  for (const Vec3& p : points)
    r->emplace_back(float(p[0] - origin[0]), float(p[1] - origin[1]), float(p[2] - origin[2]));
  return r;
}

/// A problem with the guess's translation as its origin.
struct Problem {
  Cloud::Ptr source, target;
  Eigen::Vector3d at;
  Eigen::Matrix4f begin;

  Problem(const std::vector<Vec3>& scan, const LocalMapView& map, const Eigen::Isometry3d& guess,
          const RegistrationSettings& settings)
      : source(cloud_of(thinned(scan, settings.scan_voxel_m), {0, 0, 0})),
        at(guess.translation()),
        begin(guess.matrix().cast<float>()) {
    target = cloud_of(thinned(map.cloud().xyz, settings.map_voxel_m), {at[0], at[1], at[2]});
    begin.block<3, 1>(0, 3).setZero();
  }
  [[nodiscard]] bool is_empty() const { return source->size() < 20 || target->size() < 20; }
};

Result<Registration> result_of(Method& method, const Problem& problem, const char* name, double reach_m) {
  Registration r;
  r.points = r.matched = problem.source->size();
  r.converged = method.hasConverged();
  r.rms_m = std::sqrt(method.getFitnessScore(reach_m * reach_m));
  const Eigen::Matrix4d t = method.getFinalTransformation().cast<double>();
  r.T_map_scan.linear() = Eigen::Quaterniond(Eigen::Matrix3d(t.block<3, 3>(0, 0))).normalized().matrix();
  r.T_map_scan.translation() = problem.at + t.block<3, 1>(0, 3);
  if (!r.converged || !r.T_map_scan.matrix().allFinite())
    return make_error(ErrorCode::kInvalidArgument, std::string(name) + " did not converge");
  return r;
}

/// @param run  aligns a problem.
template <class Run>
Result<Registration> guarded(const Problem& problem, const char* name, const Run& run) {
  if (problem.is_empty()) return make_error(ErrorCode::kEmpty, "too few points in the scan or around it");
  try {
    return run();
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kInvalidArgument, std::string(name) + ": " + e.what());
  }
}

Result<Registration> run_gicp(const Problem& problem, const RegistrationSettings& settings) {
  pcl::GeneralizedIterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ> gicp;
  gicp.setInputSource(problem.source);
  gicp.setInputTarget(problem.target);
  gicp.setMaximumIterations(settings.iterations);
  gicp.setTransformationEpsilon(1e-5);
  gicp.setRotationEpsilon(1e-6);
  gicp.setTranslationGradientTolerance(1e-5);
  gicp.setRotationGradientTolerance(1e-5);
  gicp.setMaximumOptimizerIterations(50);
  Cloud moved;
  gicp.setMaxCorrespondenceDistance(settings.reach_m);
  gicp.align(moved, problem.begin);
  // It has no robust kernel: partners that are far off once the scan lies right only pull.
  gicp.setMaxCorrespondenceDistance(std::min(settings.reach_m, kFineReach * settings.map_voxel_m));
  gicp.align(moved, Eigen::Matrix4f(gicp.getFinalTransformation()));
  return result_of(gicp, problem, "GICP", settings.reach_m);
}

Result<Registration> run_ndt(const Problem& problem, const RegistrationSettings& settings) {
  pcl::NormalDistributionsTransform<pcl::PointXYZ, pcl::PointXYZ> ndt;
  ndt.setInputSource(problem.source);
  ndt.setResolution(static_cast<float>(settings.ndt_cell_m));
  ndt.setInputTarget(problem.target);
  ndt.setMaximumIterations(settings.iterations);
  ndt.setTransformationEpsilon(1e-4);
  ndt.setStepSize(0.1);
  Cloud moved;
  ndt.align(moved, problem.begin);
  Registration r;
  MAPCODEC_ASSIGN(r, result_of(ndt, problem, "NDT", settings.reach_m));
  r.iterations = ndt.getFinalNumIteration();
  return r;
}

}  // namespace

bool has_pcl() {
  return true;
}

Result<Registration> register_gicp(const std::vector<Vec3>& scan, const LocalMapView& map,
                                   const Eigen::Isometry3d& guess, const RegistrationSettings& settings) {
  const Problem problem(scan, map, guess, settings);
  return guarded(problem, "GICP", [&] { return run_gicp(problem, settings); });
}

Result<Registration> register_ndt(const std::vector<Vec3>& scan, const LocalMapView& map,
                                  const Eigen::Isometry3d& guess, const RegistrationSettings& settings) {
  const Problem problem(scan, map, guess, settings);
  return guarded(problem, "NDT", [&] { return run_ndt(problem, settings); });
}

#else

bool has_pcl() {
  return false;
}

Result<Registration> register_gicp(const std::vector<Vec3>&, const LocalMapView&, const Eigen::Isometry3d&,
                                   const RegistrationSettings&) {
  return make_error(ErrorCode::kUnsupported, "built without PCL's registration library");
}

Result<Registration> register_ndt(const std::vector<Vec3>&, const LocalMapView&, const Eigen::Isometry3d&,
                                  const RegistrationSettings&) {
  return make_error(ErrorCode::kUnsupported, "built without PCL's registration library");
}

#endif

}  // namespace mapcodec::examples
