// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_voxel_errors.hpp"

namespace mapcodec::surface {
namespace {

constexpr std::uint32_t kProbes = 16;

std::array<std::uint32_t, 3> corner_of(const Units& p, int v) {
  std::array<std::uint32_t, 3> c;
  for (std::size_t d = 0; d < 3; ++d) c[d] = static_cast<std::uint32_t>(p[d]) >> v << v;
  return c;
}

constexpr double kThinSquared = 16;  // mean [units^2] below which points are taken to be on their plane

/// Errors of one voxel as a leaf on the plane that its decoder will find.
class VoxelLeaf {
 public:
  VoxelLeaf(const TreeCell& cell, const Plane& plane, LeafErrors& errors)
      : cell_(cell),
        plane_(plane),
        errors_(errors),
        polygon_(polygon_of(plane, cell.shape, Room::whole(cell.shape))) {
    const Moments m = errors.moments(cell);
    around_ = m.second[0] + m.second[1] + m.second[2];
    beside_ = squared_distances(m, cell.shape, plane);
    if (polygon_.size < 3) return;
    if (cell.count() <= LeafErrors::kFew) {
      errors.decode_few(cell, plane, polygon_);
    } else {
      missed_ = errors.missed(cell, plane, polygon_, kProbes);
      rough_ = errors.roughness(cell, plane, std::max(1.0, beside_ / cell.count()));
    }
  }

  [[nodiscard]] LeafError with(std::uint8_t noise, double lambda) const {
    if (polygon_.size < 3) return {around_, around_, around_, around_};
    if (cell_.count() <= LeafErrors::kFew) return errors_.of_few(cell_, plane_, noise);
    return errors_.of_many(cell_, plane_, polygon_, beside_, missed_, noise, rough_, lambda);
  }
  /// Whether its points are so near to the plane that a thickness can only be wrong.
  [[nodiscard]] bool is_thin() const { return beside_ < kThinSquared * cell_.count(); }

 private:
  const TreeCell& cell_;
  const Plane& plane_;
  LeafErrors& errors_;
  Polygon polygon_;
  double around_ = 0, beside_ = 0, missed_ = 0, rough_ = 0;
};

}  // namespace

VoxelErrors::VoxelErrors(std::span<const Units> points, int v, double forward_weight, double lambda)
    : points_(points), v_(v), forward_(forward_weight), lambda_(lambda) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i == 0 || corner_of(points[i - 1], v) != corner_of(points[i], v)) begin_.push_back(i);
  }
  voxels_.resize(begin_.size());
  begin_.push_back(points.size());
}

void VoxelErrors::measure(std::size_t voxel, LeafErrors& errors) {
  if (!set_) {
    set_.emplace(v_);
    set_->reserve(voxels_.size());
    for (std::size_t i = 0; i + 1 < begin_.size(); ++i) set_->insert(corner_of(points_[begin_[i]], v_));
  }
  const auto side = static_cast<std::uint8_t>(v_);
  const TreeCell cell{
      begin_[voxel], begin_[voxel + 1], corner_of(points_[begin_[voxel]], v_), {side, side, side}, 0};
  const Plane plane = set_->fit(cell.at);
  const VoxelLeaf leaf(cell, plane, errors);
  Voxel& result = voxels_[voxel];
  result.known = true;
  double flat = 0;
  for (std::uint8_t noise = 0; noise <= kMostNoise; ++noise) {
    double sum = 0;
    if (noise == 0 || !leaf.is_thin()) {
      const LeafError e = leaf.with(noise, lambda_);
      sum = forward_ * e.forth + (1 - forward_) * e.back;
      if (noise == 0) flat = sum;
    } else {
      const double thick = 2.0 * (4 << noise);
      sum = flat + cell.count() * thick * thick / 12;
    }
    result.errors[noise] = static_cast<float>(sum);
  }
}

std::size_t VoxelErrors::index_of(std::size_t point) const {
  return static_cast<std::size_t>(std::lower_bound(begin_.begin(), begin_.end(), point) - begin_.begin());
}

std::uint32_t VoxelErrors::count_in(const TreeCell& cell) const {
  return static_cast<std::uint32_t>(index_of(cell.end) - index_of(cell.begin));
}

VoxelErrors::ByNoise VoxelErrors::errors_in(const TreeCell& cell, LeafErrors& errors) {
  ByNoise sums{};
  const std::size_t end = index_of(cell.end);
  for (std::size_t i = index_of(cell.begin); i < end; ++i) {
    if (!voxels_[i].known) measure(i, errors);
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += static_cast<double>(voxels_[i].errors[k]);
  }
  return sums;
}

}  // namespace mapcodec::surface
