// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <numeric>

#include "maps/service/map_service.hpp"

namespace mapcodec {
namespace {

std::vector<std::size_t> all_of(const MapArchive& archive) {
  std::vector<std::size_t> all(archive.tiles().size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

std::vector<std::size_t> of_keys(const MapArchive& archive, const std::vector<TileSelection::Key>& keys) {
  std::vector<std::size_t> found;
  for (const auto& k : keys) {
    if (const auto at = archive.find(k.key, k.submap)) found.push_back(*at);
  }
  return found;
}

double squared_distance(const Box& box, const Vec3& p) {
  double sum = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    const double out = std::max({box.min[d] - p[d], 0.0, p[d] - box.max[d]});
    sum += out * out;
  }
  return sum;
}

std::vector<std::size_t> of_sphere(const MapArchive& archive, const TileSelection::Sphere& s) {
  std::vector<std::pair<double, std::size_t>> near;
  std::vector<RigidMotion> motions;
  for (std::uint32_t i = 0; i < std::max<std::size_t>(1, archive.info().submaps.size()); ++i)
    motions.push_back(pose_of(archive.info(), i));
  for (std::size_t i = 0; i < archive.tiles().size(); ++i) {
    const TileRecord& t = archive.tiles()[i];
    if (t.key.is_unplaced()) continue;
    const Box box = motions[std::min<std::size_t>(t.submap, motions.size() - 1)].apply(t.bounds);
    const double d = squared_distance(box, s.centre);
    if (d <= s.radius_m * s.radius_m) near.emplace_back(d, i);
  }
  std::sort(near.begin(), near.end());
  std::vector<std::size_t> found;
  for (const auto& [d, i] : near) found.push_back(i);
  return found;
}

}  // namespace

Result<std::vector<std::size_t>> MapService::select(const MapView& view, const TileSelection& selection) {
  const bool several =
      (!selection.keys.empty()) + selection.box.has_value() + selection.sphere.has_value() > 1;
  if (several)
    return make_error(ErrorCode::kInvalidArgument, "ask by keys, by a box or by a sphere: one of them");
  if (!selection.keys.empty()) return of_keys(*view.archive, selection.keys);
  if (selection.box) {
    for (std::size_t d = 0; d < 3; ++d) {
      if (!(selection.box->min[d] <= selection.box->max[d]))
        return make_error(ErrorCode::kInvalidArgument, "a box has its least corner first, without NaN");
    }
    return view.archive->tiles_in(*selection.box);
  }
  if (!selection.sphere) return all_of(*view.archive);
  if (!is_finite(selection.sphere->centre) || !(selection.sphere->radius_m >= 0))
    return make_error(ErrorCode::kInvalidArgument, "a sphere has a finite centre and a radius of 0 or more");
  return of_sphere(*view.archive, *selection.sphere);
}

}  // namespace mapcodec
