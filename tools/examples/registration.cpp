// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/examples/registration.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace mapcodec::examples {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kNarrowest = 0.01;  // [m] of the kernel
/// Partners are never looked for nearer than this many voxels of the map: its means lie that far apart.
constexpr double kNearest = 1.5;
constexpr std::size_t kFewest = 20;
/// Once steps are this short [in units of the smallest that counts], the reach shrinks to this share.
constexpr double kSettled = 40, kNarrower = 0.6;

Vector3d eigen(const Vec3& p) {
  return {p[0], p[1], p[2]};
}
Vec3 plain(const Vector3d& p) {
  return {p[0], p[1], p[2]};
}

struct Match {
  Vector3d point, normal;  // [map frame]
  double residual = 0;     // signed distance from the plane [m]
};

/// 1.48 x the median of the distances: a standard deviation that outliers do not move.
double spread(const std::vector<Match>& matches) {
  std::vector<double> r;
  for (const Match& m : matches) r.push_back(std::abs(m.residual));
  const auto middle = r.begin() + static_cast<std::ptrdiff_t>(r.size() / 2);
  std::nth_element(r.begin(), middle, r.end());
  return 1.48 * *middle;
}

/// One Gauss-Newton problem: turns about `center`, which keeps turning and moving apart.
struct Normals {
  Matrix6d h = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();
  double weighted = 0, weight = 0;
  std::size_t counted = 0;

  Normals(const std::vector<Match>& matches, const Vector3d& center, double width) {
    for (const Match& m : matches) {
      const double q = m.residual / width, w = 1 / ((1 + q * q) * (1 + q * q));
      Vector6d j;
      j << (m.point - center).cross(m.normal), m.normal;
      h += w * j * j.transpose();
      g += w * m.residual * j;
      weighted += w * m.residual * m.residual;
      weight += w;
      counted += std::abs(q) < 1 ? 1U : 0U;
    }
  }
};

class PlaneIcp {
 public:
  PlaneIcp(const SurfelMap& map, const RegistrationSettings& settings) : map_(map), settings_(settings) {}

  Result<Registration> run(const std::vector<Vec3>& scan, const Eigen::Isometry3d& guess) {
    Registration r;
    r.T_map_scan = guess;
    r.points = scan.size();
    double reach = settings_.reach_m;
    for (; r.iterations < settings_.iterations && !r.converged; ++r.iterations) {
      const std::vector<Match> matches = match(scan, r.T_map_scan, reach);
      if (matches.size() < kFewest)
        return make_error(ErrorCode::kEmpty, "too few points of the scan meet the map");
      // The kernel is as wide as the reach: what few points say about a direction counts until it fits.
      MAPCODEC_ASSIGN(const double moved, step(matches, std::max(kNarrowest, 0.5 * reach), r));
      const double least = std::min(reach, kNearest * settings_.map_voxel_m);
      const double next = std::clamp(6 * spread(matches), least, reach);
      r.converged = moved < 1 && next > 0.95 * reach;
      if (moved < kSettled) reach = std::max(next, kNarrower * reach);
    }
    return r;
  }

 private:
  std::vector<Match> match(const std::vector<Vec3>& scan, const Eigen::Isometry3d& t, double reach) const {
    std::vector<Match> matches;
    for (const Vec3& p : scan) {
      const Vector3d q = t * eigen(p);
      const Surfel* s = map_.nearest(q, reach);
      if (s != nullptr) matches.push_back({q, s->normal, s->normal.dot(q - s->center)});
    }
    return matches;
  }

  /// @return the step, in units of the smallest that counts.
  Result<double> step(const std::vector<Match>& matches, double width, Registration& r) const {
    Vector3d center = Vector3d::Zero();
    for (const Match& m : matches) center += m.point;
    center /= static_cast<double>(matches.size());
    const Normals normals(matches, center, width);
    const Eigen::SelfAdjointEigenSolver<Matrix6d> axes(normals.h);
    if (!(axes.eigenvalues()[0] > 1e-9 * axes.eigenvalues()[5]))
      return make_error(ErrorCode::kInvalidArgument, "the planes around the scan leave a direction free");
    const Vector6d x = -normals.h.ldlt().solve(normals.g);
    const Vector3d turn = x.head<3>();
    const double angle = turn.norm();
    Eigen::Isometry3d delta = Eigen::Isometry3d::Identity();
    delta.translate(center + x.tail<3>());
    if (angle > 0) delta.rotate(Eigen::AngleAxisd(angle, turn / angle));
    delta.translate(-center);
    r.T_map_scan = delta * r.T_map_scan;
    r.rms_m = std::sqrt(normals.weighted / normals.weight);
    r.matched = normals.counted;
    return std::max(x.tail<3>().norm() / settings_.step_m, angle / settings_.step_rad);
  }

  const SurfelMap& map_;
  const RegistrationSettings& settings_;
};

}  // namespace

Result<Registration> register_to_planes(const std::vector<Vec3>& scan, const LocalMapView& map,
                                        const Eigen::Isometry3d& guess, Partner partner,
                                        const RegistrationSettings& settings) {
  if (partner == Partner::patches && map.patches() == 0)
    return make_error(ErrorCode::kEmpty, "the map around the guess has no stored surfaces");
  const SurfelMap surfels(
      partner == Partner::patches ? points_on_patches(map, 0.5 * settings.map_voxel_m) : map.cloud().xyz,
      settings.map_voxel_m);
  return PlaneIcp(surfels, settings).run(thinned(scan, settings.scan_voxel_m), guess);
}

Eigen::Isometry3d to_isometry(const MapPose& p) {
  const auto& [x, y, z, w] = p.rotation_xyzw;
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.translate(eigen(p.translation_m));
  t.rotate(Eigen::Quaterniond(w, x, y, z).normalized());
  return t;
}

MapPose to_pose(const Eigen::Isometry3d& t) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(t.linear()).normalized();
  return {plain(t.translation()), {q.x(), q.y(), q.z(), q.w()}};
}

PoseDifference difference(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Isometry3d d = a.inverse() * b;
  return {1e3 * d.translation().norm(), 1e3 * std::abs(Eigen::AngleAxisd(d.linear()).angle())};
}

}  // namespace mapcodec::examples
