// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/tile_index.hpp"

#include <algorithm>
#include <nanoflann.hpp>
#include <tuple>

namespace mapcodec {
namespace {

struct PointsAdaptor {
  std::span<const Point3f> points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t d) const { return points[i][d]; }
  template <class Bounds>
  bool kdtree_get_bbox(Bounds&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointsAdaptor, double>,
                                                 PointsAdaptor, 3, std::uint32_t>;
constexpr std::size_t kLeafPoints = 16;

/// NearestHits as nanoflann wants it.
struct ResultSet {
  NearestHits& hits;
  [[nodiscard]] std::size_t size() const { return hits.hits().size(); }
  [[nodiscard]] bool full() const { return true; }
  [[nodiscard]] double worstDist() const { return hits.worst(); }
  bool addPoint(double squared, std::uint32_t point) {
    hits.add(squared, point);
    return true;
  }
};

}  // namespace

void NearestHits::add(double squared, std::uint32_t point) {
  const bool full = most_ != 0 && hits_.size() == most_;
  if (!(full ? squared < worst() : squared <= worst())) return;
  const Hit hit{tile_, point, squared};
  if (most_ == 0) {
    hits_.push_back(hit);
    return;
  }
  if (full) hits_.pop_back();
  const auto nearer = [](const Hit& a, const Hit& b) { return a.squared_m2 < b.squared_m2; };
  hits_.insert(std::upper_bound(hits_.begin(), hits_.end(), hit, nearer), hit);
}

void NearestHits::sort() {
  std::sort(hits_.begin(), hits_.end(), [](const Hit& a, const Hit& b) {
    return std::tie(a.squared_m2, a.tile, a.point) < std::tie(b.squared_m2, b.tile, b.point);
  });
}

struct TileIndex::Impl {
  explicit Impl(std::span<const Point3f> points)
      : adaptor{points}, tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafPoints)) {}
  PointsAdaptor adaptor;
  Tree tree;
};

TileIndex::TileIndex(std::span<const Point3f> points)
    : impl_(points.empty() ? nullptr : std::make_unique<Impl>(points)) {}
TileIndex::TileIndex() = default;
TileIndex::~TileIndex() = default;
TileIndex::TileIndex(TileIndex&&) noexcept = default;
TileIndex& TileIndex::operator=(TileIndex&&) noexcept = default;

void TileIndex::nearest(const Vec3& query, NearestHits& hits) const {
  if (!impl_) return;
  const Point3f q{static_cast<float>(query[0]), static_cast<float>(query[1]), static_cast<float>(query[2])};
  ResultSet set{hits};
  impl_->tree.findNeighbors(set, q.data(), nanoflann::SearchParams(0, 0.0F, false));
}

std::uint64_t TileIndex::bytes() const {
  return impl_ ? sizeof(Impl) + impl_->tree.usedMemory(impl_->tree) : 0;
}

}  // namespace mapcodec
