// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/nearest.hpp"

#include <nanoflann.hpp>

namespace mapcodec {
namespace {

struct PointsAdaptor {
  std::span<const Vec3> points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t i, std::size_t d) const { return points[i][d]; }
  template <class Bounds>
  bool kdtree_get_bbox(Bounds&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointsAdaptor>,
                                                 PointsAdaptor, 3, std::uint32_t>;
constexpr std::size_t kLeafPoints = 12;

}  // namespace

struct NeighborIndex::Impl {
  explicit Impl(std::span<const Vec3> points)
      : adaptor{points}, tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafPoints)) {}
  PointsAdaptor adaptor;
  Tree tree;
};

NeighborIndex::NeighborIndex(std::span<const Vec3> points) : impl_(std::make_unique<Impl>(points)) {}
NeighborIndex::~NeighborIndex() = default;
NeighborIndex::NeighborIndex(NeighborIndex&&) noexcept = default;
NeighborIndex& NeighborIndex::operator=(NeighborIndex&&) noexcept = default;

std::uint32_t NeighborIndex::nearest(const Vec3& query, double& squared) const {
  std::uint32_t id = 0;
  impl_->tree.knnSearch(query.data(), 1, &id, &squared);
  return id;
}

std::size_t NeighborIndex::nearest(const Vec3& query, std::span<std::uint32_t> ids,
                                   std::span<double> squared) const {
  return impl_->tree.knnSearch(query.data(), static_cast<std::uint32_t>(ids.size()), ids.data(),
                               squared.data());
}

Nearest find_nearest(std::span<const Vec3> from, const NeighborIndex& to, Runner& runner) {
  Nearest r{std::vector<std::uint32_t>(from.size()), std::vector<double>(from.size())};
  runner.run(from.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) r.index[i] = to.nearest(from[i], r.squared[i]);
  });
  return r;
}

DistanceStats summarise(std::span<const Vec3> from, std::span<const Vec3> to, const Nearest& nearest) {
  DistanceStats s;
  double largest_squared = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    s.mean_squared += nearest.squared[i];
    largest_squared = std::max(largest_squared, nearest.squared[i]);
    const Vec3& q = to[nearest.index[i]];
    for (std::size_t d = 0; d < 3; ++d) s.max_axis_m = std::max(s.max_axis_m, std::abs(from[i][d] - q[d]));
  }
  s.mean_squared /= static_cast<double>(from.size());
  s.max_m = std::sqrt(largest_squared);
  return s;
}

}  // namespace mapcodec
