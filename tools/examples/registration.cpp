// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/examples/registration.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <map>

namespace mapcodec::examples {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A plane is fitted to this many map points, and several patches are tried: the centre of the right one is
/// not always the nearest.
constexpr std::size_t kPlanePoints = 12, kPatches = 4;
/// Beyond its rim a patch still counts for this share of its radius.
constexpr double kRim = 0.25;
/// A fitted plane must be this much wider than thick.
constexpr double kFlat = 5;
constexpr double kNarrowest = 0.01;  // [m] of the kernel
constexpr std::size_t kFewest = 20;

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

/// The plane through the map points around p; false if they are no plane.
/// @param around_m  how far its points may be; @param reach_m  how far the plane.
bool plane_of_points(const LocalMapView& map, const Vector3d& p, double around_m, double reach_m, Match& m) {
  const auto near = map.nearest(plain(p), kPlanePoints, around_m);
  if (near.size() < kPlanePoints / 2) return false;
  Vector3d mean = Vector3d::Zero();
  for (const auto& n : near) mean += eigen(map.point(n));
  mean /= static_cast<double>(near.size());
  Matrix3d covariance = Matrix3d::Zero();
  for (const auto& n : near) {
    const Vector3d d = eigen(map.point(n)) - mean;
    covariance += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(covariance);
  if (!(axes.eigenvalues()[1] > kFlat * kFlat * axes.eigenvalues()[0])) return false;
  m = {p, axes.eigenvectors().col(0), axes.eigenvectors().col(0).dot(p - mean)};
  return std::abs(m.residual) <= reach_m;
}

/// The stored patch that p lies over with the least distance.
bool plane_of_patches(const LocalMapView& map, const Vector3d& p, double around_m, double reach_m, Match& m) {
  bool found = false;
  for (const auto& n : map.nearest_patches(plain(p), kPatches, around_m)) {
    const LocalMapView::Plane plane = map.plane(n);
    const Vector3d normal = eigen(plane.normal), d = p - eigen(plane.center);
    const double height = normal.dot(d), beside = (d - height * normal).norm();
    if (beside > (1 + kRim) * double(plane.patch->radius_m) || std::abs(height) > reach_m) continue;
    if (found && std::abs(height) >= std::abs(m.residual)) continue;
    m = {p, normal, height};
    found = true;
  }
  return found;
}

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
  PlaneIcp(const LocalMapView& map, Partner partner, const RegistrationSettings& settings)
      : map_(map), partner_(partner), settings_(settings) {}

  Result<Registration> run(const std::vector<Vec3>& scan, const Eigen::Isometry3d& guess) {
    Registration r;
    r.T_map_scan = guess;
    r.points = scan.size();
    double reach = settings_.reach_m;
    for (; r.iterations < settings_.iterations && !r.converged; ++r.iterations) {
      const std::vector<Match> matches = match(scan, r.T_map_scan, reach);
      if (matches.size() < kFewest)
        return make_error(ErrorCode::kEmpty, "too few points of the scan meet the map");
      const double sigma = spread(matches);
      MAPCODEC_ASSIGN(const double moved, step(matches, std::max(kNarrowest, 3 * sigma), r));
      // What lies far off by now has no partner.
      const double next = std::clamp(6 * sigma, 0.1, reach);
      r.converged = moved < 1 && next > 0.95 * reach;
      reach = std::max(next, 0.7 * reach);
    }
    return r;
  }

 private:
  std::vector<Match> match(const std::vector<Vec3>& scan, const Eigen::Isometry3d& t, double reach) const {
    std::vector<Match> matches;
    for (const Vec3& p : scan) {
      Match m;
      const Vector3d q = t * eigen(p);
      if (partner_ == Partner::patches ? plane_of_patches(map_, q, 2 * settings_.reach_m, reach, m)
                                       : plane_of_points(map_, q, settings_.reach_m, reach, m))
        matches.push_back(m);
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

  const LocalMapView& map_;
  Partner partner_;
  const RegistrationSettings& settings_;
};

}  // namespace

Result<Registration> register_to_planes(const std::vector<Vec3>& scan, const LocalMapView& map,
                                        const Eigen::Isometry3d& guess, Partner partner,
                                        const RegistrationSettings& settings) {
  if (partner == Partner::patches && map.patches() == 0)
    return make_error(ErrorCode::kEmpty, "the map around the guess has no stored surfaces");
  return PlaneIcp(map, partner, settings).run(thinned(scan, settings.scan_voxel_m), guess);
}

std::vector<Vec3> thinned(const std::vector<Vec3>& points, double voxel_m) {
  if (!(voxel_m > 0)) return points;
  struct Sum {
    Vec3 sum{0, 0, 0};
    double count = 0;
  };
  std::map<Vec3, std::size_t> index;
  std::vector<Sum> sums;
  for (const Vec3& p : points) {
    const Vec3 cell{std::floor(p[0] / voxel_m), std::floor(p[1] / voxel_m), std::floor(p[2] / voxel_m)};
    const auto [at, fresh] = index.try_emplace(cell, sums.size());
    if (fresh) sums.emplace_back();
    Sum& s = sums[at->second];
    for (std::size_t d = 0; d < 3; ++d) s.sum[d] += p[d];
    s.count += 1;
  }
  std::vector<Vec3> r;
  for (const Sum& s : sums) r.push_back({s.sum[0] / s.count, s.sum[1] / s.count, s.sum[2] / s.count});
  return r;
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
