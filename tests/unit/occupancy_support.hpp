// SPDX-License-Identifier: GPL-3.0-or-later
// Octrees to test with: a bubble of free space with a bumpy shell.
#pragma once

#include <bit>
#include <cmath>
#include <random>

#include "mapcodec/cloud/occupancy_pieces.hpp"

namespace mapcodec::test {

class BubbleMaker {
 public:
  BubbleMaker(OccupancyKind kind, double radius, unsigned seed)
      : kind_(kind), radius_(radius), random_(seed) {}

  OccupancyTree make() {
    tree_ = {};
    tree_.kind = kind_;
    tree_.root = cell({0, 0, 0}, kOccupancyHeight);
    return std::move(tree_);
  }

 private:
  /// Of one voxel.
  [[nodiscard]] Cell at(const CellCorner& v) const {
    double d2 = 0;
    for (const std::uint32_t x : v) d2 += (double(x) - 32768.3) * (double(x) - 32768.3);
    const double bump = 1.5 * std::sin(0.7 * double(v[0])) * std::sin(0.5 * double(v[1]));
    const double d = std::sqrt(d2) - radius_ - bump;
    return d < -1 ? Cell::free : (d < 1 ? Cell::occupied : Cell::unknown);
  }
  /// Whether the cube is surely of one kind.
  [[nodiscard]] bool uniform(const CellCorner& c, unsigned height, Cell& cell) const {
    const double half = double(1u << height) / 2;
    double d2 = 0;
    for (const std::uint32_t x : c) d2 += (double(x) + half - 32768.3) * (double(x) + half - 32768.3);
    const double d = std::sqrt(d2) - radius_, reach = half * 1.7321 + 3;
    if (std::abs(d) <= reach) return false;
    cell = d < 0 ? Cell::free : Cell::unknown;
    return true;
  }

  Cell leaf(Cell c, unsigned height, const CellCorner& corner) {
    OccupancyLevel& l = tree_.levels[height];
    if (c == Cell::unknown || kind_ == OccupancyKind::binary) return c;
    const float steps = static_cast<float>(random_() % 4 + 1);
    l.leaf_values.push_back(std::bit_cast<std::uint32_t>(c == Cell::free ? -0.405F * steps : 0.847F * steps));
    if (kind_ != OccupancyKind::color) return c;
    const auto shade = static_cast<std::uint8_t>(100 + corner[0] % 100 + random_() % 8);
    l.leaf_colors.push_back(
        c == Cell::free ? kNoColor : OccupancyColor{shade, 90, static_cast<std::uint8_t>(corner[2])});
    return c;
  }

  Cell cell(const CellCorner& corner, unsigned height) {
    Cell whole = Cell::unknown;
    if (height == 0) return leaf(at(corner), 0, corner);
    if (uniform(corner, height, whole)) return leaf(whole, height, corner);
    OccupancyLevel& own = tree_.levels[height];
    const OccupancyLevel& below = tree_.levels[height - 1];
    const std::size_t i = own.nodes.size();
    own.nodes.push_back(0);
    std::uint32_t node = 0;
    NodeSummary s;
    for (unsigned c = 0; c < 8; ++c) {
      const Cell child = cell(child_corner(corner, c, height - 1), height - 1);
      node |= static_cast<std::uint32_t>(child) << (2 * c);
      if (child == Cell::unknown || kind_ == OccupancyKind::binary) continue;
      const bool inner = child == Cell::inner;
      const auto& colors = inner ? below.node_colors : below.leaf_colors;
      s.add((inner ? below.node_values : below.leaf_values).back(),
            colors.empty() ? kNoColor : colors.back());
    }
    if (node == 0) {
      own.nodes.pop_back();
      return Cell::unknown;
    }
    own.nodes[i] = static_cast<std::uint16_t>(node);
    if (kind_ != OccupancyKind::binary) own.node_values.push_back(s.value());
    if (kind_ == OccupancyKind::color) own.node_colors.push_back(s.color());
    return Cell::inner;
  }

  OccupancyKind kind_;
  double radius_;
  std::mt19937 random_;
  OccupancyTree tree_;
};

inline OccupancyTree bubble(OccupancyKind kind, double radius, unsigned seed = 1) {
  return BubbleMaker(kind, radius, seed).make();
}

inline constexpr OccupancyKind kAllKinds[] = {OccupancyKind::binary, OccupancyKind::log_odds,
                                              OccupancyKind::color};

}  // namespace mapcodec::test
