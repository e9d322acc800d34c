// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/examples/surfels.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <unordered_map>

#include "slam_adapter/tile_index.hpp"

namespace mapcodec::examples {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Neighbours that a plane is fitted to: as few as will do, for near surfaces bend; more where these lie in a
/// row, as on a ring of a spinning sensor.
constexpr std::array<std::size_t, 2> kNeighbors{12, 30};
/// A plane is this much wider than thick ...
constexpr double kFlat = 5;
/// ... and no row: this share of its length.
constexpr double kWide = 0.25;
/// Neighbours are not farther than so many voxels.
constexpr double kAround = 10;

struct CellHash {
  std::size_t operator()(const std::array<std::int64_t, 3>& c) const {
    std::uint64_t h = 0;
    for (const std::int64_t x : c) h = (h ^ static_cast<std::uint64_t>(x)) * 0x9E3779B97F4A7C15u + (h >> 29);
    return static_cast<std::size_t>(h ^ (h >> 32));
  }
};

Vector3d eigen(const Vec3& p) {
  return {p[0], p[1], p[2]};
}

/// False if the points are no plane.
bool fit(const std::vector<Vec3>& points, const std::vector<NearestHits::Hit>& near, Surfel& surfel) {
  Vector3d mean = Vector3d::Zero();
  for (const auto& n : near) mean += eigen(points[n.point]);
  mean /= static_cast<double>(near.size());
  Matrix3d covariance = Matrix3d::Zero();
  for (const auto& n : near) {
    const Vector3d d = eigen(points[n.point]) - mean;
    covariance += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(covariance);
  const Vector3d& e = axes.eigenvalues();
  if (!(e[1] > kFlat * kFlat * e[0]) || !(e[1] > kWide * kWide * e[2])) return false;
  surfel = {mean, axes.eigenvectors().col(0)};
  return true;
}

}  // namespace

struct SurfelMap::Impl {
  std::vector<Vec3> means;      // [m, map frame]
  Vec3 origin{0, 0, 0};         // of `local`
  std::vector<Point3f> local;   // the means, for the index
  std::vector<Surfel> surfels;  // of each mean
  std::vector<std::uint8_t> flat;
  TileIndex index;

  Vec3 from_origin(const Vec3& p) const { return {p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]}; }

  void fit_one(std::size_t i, double around_m) {
    for (const std::size_t most : kNeighbors) {
      NearestHits hits(most, around_m);
      index.nearest(from_origin(means[i]), hits);
      if (hits.hits().size() < kNeighbors[0] / 2) return;
      flat[i] = fit(means, hits.hits(), surfels[i]);
      if (flat[i] != 0 || hits.hits().size() < most) return;
    }
  }
};

SurfelMap::SurfelMap(const std::vector<Vec3>& points, double voxel_m) : impl_(std::make_unique<Impl>()) {
  Impl& m = *impl_;
  m.means = thinned(points, voxel_m);
  if (!m.means.empty()) m.origin = m.means.front();
  for (const Vec3& p : m.means) {
    const Vec3 d = m.from_origin(p);
    m.local.push_back({float(d[0]), float(d[1]), float(d[2])});
  }
  m.index = TileIndex(m.local);
  m.surfels.resize(m.means.size());
  m.flat.resize(m.means.size());
  for (std::size_t i = 0; i < m.means.size(); ++i) m.fit_one(i, kAround * voxel_m);
}

SurfelMap::~SurfelMap() = default;

const Surfel* SurfelMap::nearest(const Vector3d& p, double within_m) const {
  NearestHits hits(1, within_m);
  impl_->index.nearest(impl_->from_origin({p[0], p[1], p[2]}), hits);
  if (hits.hits().empty()) return nullptr;
  const std::size_t at = hits.hits().front().point;
  return impl_->flat[at] != 0 ? &impl_->surfels[at] : nullptr;
}

std::vector<Vec3> thinned(const std::vector<Vec3>& points, double voxel_m) {
  if (!(voxel_m > 0)) return points;
  struct Sum {
    Vec3 sum{0, 0, 0};
    double count = 0;
  };
  std::unordered_map<std::array<std::int64_t, 3>, std::size_t, CellHash> index;
  std::vector<Sum> sums;
  for (const Vec3& p : points) {
    std::array<std::int64_t, 3> cell{};
    for (std::size_t d = 0; d < 3; ++d) cell[d] = static_cast<std::int64_t>(std::floor(p[d] / voxel_m));
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

std::vector<Vec3> points_on_patches(const LocalMapView& map, double spacing_m) {
  std::vector<Vec3> points;
  for (std::uint32_t t = 0; t < map.tiles().size(); ++t) {
    const std::size_t count = map.tiles()[t].content->patches.size();
    for (std::uint32_t i = 0; i < count; ++i) {
      const LocalMapView::Plane plane = map.plane({t, i, 0});
      // The disc of the patch's area: the one of its radius would reach beyond long patches.
      const double pi = 3.14159265358979323846;
      const double radius =
          std::min(double(plane.patch->radius_m), std::sqrt(double(plane.patch->area_m2) / pi));
      const Vector3d n = eigen(plane.normal), c = eigen(plane.center);
      const Vector3d u = n.unitOrthogonal(), v = n.cross(u);
      const auto half = static_cast<int>(std::min(100.0, radius / spacing_m));
      for (int a = -half; a <= half; ++a) {
        for (int b = -half; b <= half; ++b) {
          const Vector3d d = spacing_m * (a * u + b * v);
          if (d.norm() > radius && (a != 0 || b != 0)) continue;
          const Vector3d p = c + d;
          points.push_back({p[0], p[1], p[2]});
        }
      }
    }
  }
  return points;
}

}  // namespace mapcodec::examples
