// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/plane_ransac.hpp"

#include <pcl/console/print.h>
#include <pcl/point_types.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>
#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <mutex>

namespace mapcodec {
namespace {

constexpr std::size_t kScoredPoints = 2000;
constexpr int kMaxIterations = 1000;

Plane make_plane(const Eigen::Vector3d& direction, const Eigen::Vector3d& through) {
  Eigen::Vector3d n = direction.normalized();
  Eigen::Index k = 0;
  n.cwiseAbs().maxCoeff(&k);
  if (n[k] < 0) n = -n;
  return {{n[0], n[1], n[2]}, n.dot(through)};
}

/// Least squares through the points within `distance_m` of `plane`; `plane` itself if they are fewer than
/// three.
Plane refit(const Plane& plane, std::span<const Vec3> xyz, std::span<const std::uint32_t> remaining,
            double distance_m) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  double count = 0;
  for (const std::uint32_t i : remaining) {
    if (std::abs(plane.distance(xyz[i])) > distance_m) continue;
    const Eigen::Vector3d p(xyz[i][0], xyz[i][1], xyz[i][2]);
    sum += p;
    products += p * p.transpose();
    ++count;
  }
  if (count < 3) return plane;
  const Eigen::Vector3d mean = sum / count;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(products / count - mean * mean.transpose());
  return make_plane(axes.eigenvectors().col(0), mean);
}

pcl::PointCloud<pcl::PointXYZ>::Ptr take_evenly(std::span<const Vec3> xyz,
                                                std::span<const std::uint32_t> remaining) {
  auto cloud = pcl::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
  const std::size_t count = std::min(remaining.size(), kScoredPoints);
  cloud->reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3& p = xyz[remaining[i * remaining.size() / count]];
    cloud->emplace_back(static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]));
  }
  return cloud;
}

/// PCL's plane model with the same count from coordinates that lie side by side: the compiler does four
/// points at once, where PCL goes through an index and a padded point for each.
class PlaneModel : public pcl::SampleConsensusModelPlane<pcl::PointXYZ> {
 public:
  explicit PlaneModel(const pcl::PointCloud<pcl::PointXYZ>::ConstPtr& cloud)
      : SampleConsensusModelPlane(cloud, false) {
    for (std::vector<float>& axis : axes_) axis.reserve(cloud->size());
    for (const pcl::PointXYZ& p : *cloud) {
      axes_[0].push_back(p.x);
      axes_[1].push_back(p.y);
      axes_[2].push_back(p.z);
    }
  }
  std::size_t countWithinDistance(const Eigen::VectorXf& plane, const double threshold) const override {
    if (!isModelValid(plane)) return 0;
    const float a = plane[0], b = plane[1], c = plane[2], d = plane[3];
    const auto limit = static_cast<float>(threshold);
    const float *x = axes_[0].data(), *y = axes_[1].data(), *z = axes_[2].data();
    const std::size_t size = axes_[0].size();
    std::uint32_t near = 0;
    for (std::size_t i = 0; i < size; ++i) near += std::abs(a * x[i] + b * y[i] + c * z[i] + d) < limit;
    return near;
  }

 private:
  std::array<std::vector<float>, 3> axes_;
};

/// PCL prints what it cannot fit; a library must not.
void silence_pcl() {
  static std::once_flag once;
  std::call_once(once, [] { pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS); });
}

std::optional<Plane> search(std::span<const Vec3> xyz, std::span<const std::uint32_t> remaining,
                            double distance_m) {
  silence_pcl();
  const auto model = pcl::make_shared<PlaneModel>(take_evenly(xyz, remaining));
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(model, distance_m);
  ransac.setMaxIterations(kMaxIterations);
  ransac.setProbability(0.99);
  if (!ransac.computeModel()) return std::nullopt;
  Eigen::VectorXf found;
  ransac.getModelCoefficients(found);
  if (found.size() != 4 || !found.allFinite()) return std::nullopt;
  const Eigen::Vector3d n = found.head<3>().cast<double>();
  return make_plane(n, n * (-static_cast<double>(found[3]) / n.squaredNorm()));
}

}  // namespace

std::optional<Plane> find_largest_plane(std::span<const Vec3> xyz, std::span<const std::uint32_t> remaining,
                                        double distance_m) {
  if (remaining.size() < 3) return std::nullopt;
  const std::optional<Plane> found = search(xyz, remaining, distance_m);
  if (!found) return std::nullopt;
  return refit(*found, xyz, remaining, distance_m);
}

}  // namespace mapcodec
