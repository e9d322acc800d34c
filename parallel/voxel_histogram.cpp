// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/voxel_histogram.hpp"

#include <limits>
#include <utility>

namespace mapcodec {
namespace {

constexpr double kIndexRange = 1073741824.0;  // 2^30

std::size_t hash(const CellIndex& c) {
  std::uint64_t h = std::uint64_t(std::uint32_t(c.x)) * 0x9E3779B97F4A7C15u;
  h ^= std::uint64_t(std::uint32_t(c.y)) * 0xC2B2AE3D27D4EB4Fu;
  h ^= std::uint64_t(std::uint32_t(c.z)) * 0x165667B19E3779F9u;
  return static_cast<std::size_t>((h ^ (h >> 32)) * 0x9E3779B97F4A7C15u >> 20);
}

std::uint32_t saturating_sum(std::uint32_t a, std::uint32_t b) {
  const std::uint32_t s = a + b;
  return s < a ? std::numeric_limits<std::uint32_t>::max() : s;
}

bool in_range(double v) {
  return v >= -kIndexRange && v < kIndexRange;
}

}  // namespace

VoxelHistogram::VoxelHistogram(const Vec3& origin, int exponent, std::size_t max_cells)
    : origin_(origin),
      exponent_(exponent),
      per_m_(std::ldexp(1.0, -exponent)),
      max_cells_(max_cells),
      slots_(4096) {}

std::size_t VoxelHistogram::find(const CellIndex& c) const {
  const std::size_t mask = slots_.size() - 1;
  std::size_t s = hash(c) & mask;
  while (slots_[s].points != 0 && !(slots_[s].index == c)) s = (s + 1) & mask;
  return s;
}

void VoxelHistogram::add(const Vec3& p) {
  const Vec3 d{p[0] - origin_[0], p[1] - origin_[1], p[2] - origin_[2]};
  Vec3 v{d[0] * per_m_, d[1] * per_m_, d[2] * per_m_};
  while (!in_range(v[0]) || !in_range(v[1]) || !in_range(v[2])) {
    coarsen();
    v = {d[0] * per_m_, d[1] * per_m_, d[2] * per_m_};
  }
  count({floor_to_int(v[0]), floor_to_int(v[1]), floor_to_int(v[2])}, 1);
}

void VoxelHistogram::count(const CellIndex& c, std::uint32_t points) {
  if (!(slots_[last_].points != 0 && slots_[last_].index == c)) last_ = find(c);
  Cell& cell = slots_[last_];
  if (cell.points != 0) {
    cell.points = saturating_sum(cell.points, points);
    return;
  }
  cell = {c, points};
  ++occupied_;
  while (occupied_ > max_cells_) coarsen();
  if (occupied_ * 2 > slots_.size()) rebuild(slots_.size() * 2, 0);
}

void VoxelHistogram::rebuild(std::size_t slots, int shift) {
  const std::vector<Cell> old = std::exchange(slots_, std::vector<Cell>(slots));
  exponent_ += shift;
  per_m_ = std::ldexp(1.0, -exponent_);
  occupied_ = 0;
  last_ = 0;
  for (const Cell& c : old) {
    if (c.points == 0) continue;
    const CellIndex to{c.index.x >> shift, c.index.y >> shift, c.index.z >> shift};
    Cell& cell = slots_[find(to)];
    occupied_ += cell.points == 0;
    cell = {to, saturating_sum(cell.points, c.points)};
  }
}

void VoxelHistogram::merge(const VoxelHistogram& other) {
  while (exponent_ < other.exponent_) coarsen();
  for (const Cell& c : other.slots_) {
    if (c.points == 0) continue;
    const int shift = exponent_ - other.exponent_;  // grows when the merging itself overflows
    count({c.index.x >> shift, c.index.y >> shift, c.index.z >> shift}, c.points);
  }
}

std::vector<VoxelHistogram::Cell> VoxelHistogram::cells() const {
  std::vector<Cell> r;
  r.reserve(occupied_);
  for (const Cell& c : slots_) {
    if (c.points != 0) r.push_back(c);
  }
  return r;
}

}  // namespace mapcodec
