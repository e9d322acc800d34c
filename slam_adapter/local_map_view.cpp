// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/local_map_view.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

double squared_distance(const Box& box, const Vec3& p) {
  double sum = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    const double out = std::max({box.min[d] - p[d], p[d] - box.max[d], 0.0});
    sum += out * out;
  }
  return sum;
}

/// The queried point in the frames of the submaps, moved once for the tiles of one submap in a row.
class QueryFrames {
 public:
  explicit QueryFrames(const Vec3& p) : p_(p), moved_(p) {}
  const Vec3& in(const LocalMapView::Tile& tile) {
    if (!any_ || submap_ != tile.content->submap) {
      any_ = true;
      submap_ = tile.content->submap;
      moved_ = tile.T_map_submap.apply_inverse(p_);
    }
    return moved_;
  }

 private:
  Vec3 p_, moved_;
  std::uint32_t submap_ = 0;
  bool any_ = false;
};

bool all_have_channels(const std::vector<LocalMapView::Tile>& tiles) {
  return std::all_of(tiles.begin(), tiles.end(), [](const LocalMapView::Tile& t) {
    return t.content->points.empty() || !t.content->channels.empty();
  });
}

}  // namespace

std::size_t LocalMapView::points() const {
  std::size_t sum = 0;
  for (const Tile& t : tiles_) sum += t.content->points.size();
  return sum;
}

std::size_t LocalMapView::patches() const {
  std::size_t sum = 0;
  for (const Tile& t : tiles_) sum += t.content->patches.size();
  return sum;
}

std::uint64_t LocalMapView::bytes() const {
  std::uint64_t sum = 0;
  for (const Tile& t : tiles_) sum += t.content->held.bytes();
  return sum;
}

std::vector<LocalNeighbor> LocalMapView::search(const Vec3& p, std::size_t most, double radius_m,
                                                What what) const {
  if (!is_finite(p) || !(radius_m >= 0)) return {};
  NearestHits hits(most, radius_m);
  // First the tiles around the point: they leave little to look for in the others.
  for (const bool around : {true, false}) {
    QueryFrames frames(p);
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
      const LocalTile& tile = *tiles_[i].content;
      const Vec3& q = frames.in(tiles_[i]);
      const double squared = squared_distance(tile.bounds, q);
      if ((squared == 0) != around || squared > hits.worst()) continue;
      hits.set_tile(static_cast<std::uint32_t>(i));
      (what == What::points ? tile.point_index : tile.patch_index).nearest(tile.to_origin(q), hits);
    }
  }
  if (most == 0) hits.sort();
  std::vector<LocalNeighbor> r;
  r.reserve(hits.hits().size());
  for (const NearestHits::Hit& h : hits.hits()) r.push_back({h.tile, h.point, std::sqrt(h.squared_m2)});
  return r;
}

std::vector<LocalNeighbor> LocalMapView::nearest(const Vec3& p, std::size_t most, double radius_m) const {
  if (most == 0) return {};
  return search(p, most, radius_m, What::points);
}

std::vector<LocalNeighbor> LocalMapView::within(const Vec3& p, double radius_m) const {
  if (!std::isfinite(radius_m)) return {};
  return search(p, 0, radius_m, What::points);
}

std::vector<LocalNeighbor> LocalMapView::nearest_patches(const Vec3& p, std::size_t most,
                                                         double radius_m) const {
  if (most == 0) return {};
  return search(p, most, radius_m, What::patches);
}

Vec3 LocalMapView::point(const LocalNeighbor& n) const {
  const Tile& t = tiles_[n.tile];
  return t.T_map_submap.apply(t.content->from_origin(t.content->points[n.index]));
}

LocalMapView::Plane LocalMapView::plane(const LocalNeighbor& n) const {
  const Tile& t = tiles_[n.tile];
  const LocalPatch& p = t.content->patches[n.index];
  return {t.T_map_submap.apply(t.content->from_origin(p.center)),
          t.T_map_submap.rotate({p.normal[0], p.normal[1], p.normal[2]}), &p};
}

PointCloud LocalMapView::cloud() const {
  PointCloud all;
  const bool channels = all_have_channels(tiles_);
  for (const Tile& t : tiles_) {
    const LocalTile& tile = *t.content;
    PointCloud some;
    for (const Point3f& p : tile.points) some.xyz.push_back(t.T_map_submap.apply(tile.from_origin(p)));
    if (channels) some.channels = tile.channels;
    if (some.empty()) continue;
    if (all.empty()) {
      all = std::move(some);
    } else {
      all.append(some);
    }
  }
  return all;
}

}  // namespace mapcodec
