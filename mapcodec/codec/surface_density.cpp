// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_density.hpp"

#include <algorithm>
#include <bit>

namespace mapcodec::surface {
namespace {

constexpr std::int64_t kMostTilt = 192;     // [1/256]
constexpr std::int64_t kSteepest = 0xffff;  // [1/256]: steeper planes do not stretch areas more
constexpr std::uint64_t kMostArea = std::uint64_t{1} << 60;

/// Area of a leaf's polygon [units^2], its slope included within 7 %; 0 without polygon.
std::uint64_t measure(const Leaf& leaf, const Outline& outline) {
  const unsigned u = (leaf.plane.axis + 1u) % 3, v = (leaf.plane.axis + 2u) % 3;
  Polygon polygon = polygon_of(leaf.plane, leaf.shape, Room::in(outline, leaf.at, leaf.shape));
  if (polygon.size >= 3 && leaf.wedged) cut(polygon, leaf.wedge);
  const std::int64_t twice = twice_area(polygon);
  if (polygon.size < 3 || twice <= 0) return 0;
  const int shift = 33 - leaf.shape[u] - leaf.shape[v];
  const auto flat = static_cast<std::uint64_t>(shift >= 0 ? twice >> shift : twice << -shift);
  const auto slope = [&](std::int32_t rise, unsigned axis) {
    return std::min(std::abs(std::int64_t{rise} * 256 / half_side(leaf.shape[axis])), kSteepest);
  };
  const std::int64_t a = slope(leaf.plane.a, u), b = slope(leaf.plane.b, v);
  const std::int64_t steep = std::max(a, b) + std::min(a, b) * 3 / 8, one = 256;
  const std::int64_t stretch = std::max(steep, one) + std::min(steep, one) * 3 / 8;
  return std::max<std::uint64_t>(1, (flat * static_cast<std::uint64_t>(stretch)) >> 8);
}

/// What both sides say, cautiously where they do not agree.
std::int32_t combined(bool has_lower, std::int64_t lower, bool has_upper, std::int64_t upper) {
  std::int64_t tilt = (has_lower ? lower : 0) + (has_upper ? upper : 0);
  if (has_lower && has_upper) {
    const std::int64_t least = std::min(std::abs(lower), std::abs(upper));
    const bool agree = (lower < 0) == (upper < 0);
    tilt = agree ? std::min(std::abs(lower + upper) / 2, 2 * least) * (lower < 0 ? -1 : 1) : 0;
  }
  return static_cast<std::int32_t>(std::clamp(tilt, -kMostTilt, kMostTilt));
}

}  // namespace

DensityTable::DensityTable(std::span<const Leaf> leaves, const Outline& outline)
    : leaves_(leaves), outline_(outline) {}

std::uint64_t DensityTable::area_of(std::int32_t leaf) {
  const auto i = static_cast<std::size_t>(leaf);
  if (areas_.empty()) areas_.resize(leaves_.size());
  if (areas_[i] == 0) areas_[i] = measure(leaves_[i], outline_) + 1;
  return areas_[i] - 1;
}

void DensityTable::add_beside(std::size_t seam, std::int32_t from, std::int32_t to, unsigned face) {
  if (entries_.size() <= seam) entries_.resize(seam + 1);
  Entry& e = entries_[seam];
  e.leaf = from;
  const Leaf &leaf = leaves_[static_cast<std::size_t>(from)], &other = leaves_[static_cast<std::size_t>(to)];
  const bool is_u = face / 2 == (leaf.plane.axis + 1u) % 3;
  Beyond& b = e.beyond[(is_u ? 0 : 2) + face % 2];
  b.points += other.count;
  b.area = std::min(b.area + area_of(to), kMostArea);
  b.sides += std::uint64_t{1} << other.shape[face / 2];
  ++b.leaves;
}

/// By how much the density changes towards a face, in 1/256 of the leaf's own per half of its side; nothing
/// where it cannot be told.
bool DensityTable::rise_to(std::int32_t leaf, const Beyond& beyond, unsigned axis, std::int64_t& rise) {
  const Leaf& l = leaves_[static_cast<std::size_t>(leaf)];
  const std::uint64_t area = area_of(leaf);
  if (beyond.area == 0 || area == 0) return false;
  const int count_bits =
      std::max(0, static_cast<int>(std::bit_width(std::max<std::uint64_t>(beyond.points, l.count))) - 24);
  const int area_bits = std::max(0, static_cast<int>(std::bit_width(std::max(beyond.area, area))) - 28);
  const auto there = static_cast<std::int64_t>((beyond.points >> count_bits) * (area >> area_bits));
  const auto here =
      static_cast<std::int64_t>((std::uint64_t{l.count} >> count_bits) * (beyond.area >> area_bits));
  if (there + here <= 0) return false;
  // Between the middles, in 1/16 of half the side.
  const auto distance = 16 + static_cast<std::int64_t>((beyond.sides / beyond.leaves) << 4 >> l.shape[axis]);
  rise = (there - here) / std::max<std::int64_t>(1, (there + here) >> 9) * 16 / distance;
  return true;
}

Tilt DensityTable::tilt_of(std::size_t seam) {
  Tilt tilt;
  if (seam >= entries_.size() || entries_[seam].leaf < 0) return tilt;
  const Entry& e = entries_[seam];
  const unsigned k = leaves_[static_cast<std::size_t>(e.leaf)].plane.axis;
  for (unsigned side = 0; side < 2; ++side) {
    std::int64_t lower = 0, upper = 0;
    const unsigned axis = (k + 1 + side) % 3;
    const bool has_lower = rise_to(e.leaf, e.beyond[2 * side], axis, lower);
    const bool has_upper = rise_to(e.leaf, e.beyond[2 * side + 1], axis, upper);
    (side == 0 ? tilt.u : tilt.v) = combined(has_lower, -lower, has_upper, upper);
  }
  return tilt;
}

}  // namespace mapcodec::surface
