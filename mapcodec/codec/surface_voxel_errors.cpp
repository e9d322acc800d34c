// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_voxel_errors.hpp"

#include "mapcodec/codec/surface_blocks.hpp"

namespace mapcodec::surface {
namespace {

constexpr std::uint32_t kProbes = 16;

std::array<std::uint32_t, 3> corner_of(const Units& p, int v) {
  std::array<std::uint32_t, 3> c;
  for (std::size_t d = 0; d < 3; ++d) c[d] = static_cast<std::uint32_t>(p[d]) >> v << v;
  return c;
}

LeafError error_of(const TreeCell& cell, const Plane& plane, std::uint8_t noise, LeafErrors& errors,
                   double lambda) {
  const Polygon polygon = polygon_of(plane, cell.shape);
  const Moments m = errors.moments(cell);
  if (polygon.size < 3) {
    const double sum = m.second[0] + m.second[1] + m.second[2];
    return {sum, sum, sum, sum};
  }
  if (cell.count() <= LeafErrors::kFew) return errors.of_few(cell, plane, polygon, noise);
  const double beside = squared_distances(m, cell.shape, plane);
  const double rough = noise == 0 ? 0 : errors.roughness(cell, plane, std::max(1.0, beside / cell.count()));
  return errors.of_many(cell, plane, polygon, beside, errors.missed(cell, plane, polygon, kProbes), noise,
                        rough, lambda);
}

}  // namespace

VoxelErrors::VoxelErrors(std::span<const Units> points, int v, LeafErrors& errors, double forward_weight,
                         double lambda) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i == 0 || corner_of(points[i - 1], v) != corner_of(points[i], v)) begin_.push_back(i);
  }
  VoxelSet set(v);
  set.reserve(begin_.size());
  for (const std::size_t i : begin_) set.insert(corner_of(points[i], v));
  begin_.push_back(points.size());
  for (auto& sums : sums_) sums.assign(1, 0);
  const auto side = static_cast<std::uint8_t>(v);
  for (std::size_t i = 0; i + 1 < begin_.size(); ++i) {
    const TreeCell cell{begin_[i], begin_[i + 1], corner_of(points[begin_[i]], v), {side, side, side}, 0};
    const Plane plane = set.fit(cell.at);
    for (std::uint8_t noise = 0; noise < sums_.size(); ++noise) {
      const LeafError e = error_of(cell, plane, noise, errors, lambda);
      sums_[noise].push_back(sums_[noise].back() + forward_weight * e.forth + (1 - forward_weight) * e.back);
    }
  }
}

std::size_t VoxelErrors::index_of(std::size_t point) const {
  return static_cast<std::size_t>(std::lower_bound(begin_.begin(), begin_.end(), point) - begin_.begin());
}

std::uint32_t VoxelErrors::count_in(const TreeCell& cell) const {
  return static_cast<std::uint32_t>(index_of(cell.end) - index_of(cell.begin));
}

double VoxelErrors::error_in(const TreeCell& cell, std::uint8_t noise) const {
  return sums_[noise][index_of(cell.end)] - sums_[noise][index_of(cell.begin)];
}

}  // namespace mapcodec::surface
