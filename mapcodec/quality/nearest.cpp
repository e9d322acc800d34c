// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/nearest.hpp"

#include <algorithm>
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

std::vector<std::uint32_t> NeighborIndex::within(const Vec3& query, double radius_m) const {
  std::vector<std::pair<std::uint32_t, double>> hits;
  impl_->tree.radiusSearch(query.data(), radius_m * radius_m, hits, nanoflann::SearchParams(0, 0.0F, false));
  std::vector<std::uint32_t> ids;
  ids.reserve(hits.size());
  for (const auto& hit : hits) ids.push_back(hit.first);
  return ids;
}

Nearest find_nearest(std::span<const Vec3> from, const NeighborIndex& to, Runner& runner) {
  Nearest r{std::vector<std::uint32_t>(from.size()), std::vector<double>(from.size())};
  runner.run(from.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) r.index[i] = to.nearest(from[i], r.squared[i]);
  });
  return r;
}

DistanceStats summarise(std::span<const Vec3> from, const Nearest& nearest) {
  DistanceStats s;
  double largest_squared = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    s.mean_squared += nearest.squared[i];
    largest_squared = std::max(largest_squared, nearest.squared[i]);
  }
  s.mean_squared /= static_cast<double>(from.size());
  s.max_m = std::sqrt(largest_squared);
  return s;
}

namespace {

double axis_distance(const Vec3& a, const Vec3& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

/// The maximum-norm distance to the nearest point in that norm, which is at most `bound`.
double nearest_axis_distance(const Vec3& p, std::span<const Vec3> to, const NeighborIndex& index,
                             double bound) {
  double best = bound;
  for (const std::uint32_t id : index.within(p, bound * 1.7320509))
    best = std::min(best, axis_distance(p, to[id]));
  return best;
}

}  // namespace

double max_axis_error(std::span<const Vec3> from, std::span<const Vec3> to, const NeighborIndex& index,
                      const Nearest& nearest) {
  // Upper bounds, the largest first: few of them have to be refined before none that is left can be the
  // maximum.
  std::vector<std::pair<double, std::uint32_t>> bounds(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    bounds[i] = {axis_distance(from[i], to[nearest.index[i]]), static_cast<std::uint32_t>(i)};
  }
  std::make_heap(bounds.begin(), bounds.end());
  double largest = 0;
  while (!bounds.empty() && bounds.front().first > largest) {
    const auto [bound, i] = bounds.front();
    largest = std::max(largest, nearest_axis_distance(from[i], to, index, bound));
    std::pop_heap(bounds.begin(), bounds.end());
    bounds.pop_back();
  }
  return largest;
}

}  // namespace mapcodec
