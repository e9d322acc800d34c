// SPDX-License-Identifier: GPL-3.0-or-later
// An occupancy octree as OctoMap has it [Hornung et al. 2013], exact and compact: two bytes an inner node.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "mapcodec/cloud/tile_key.hpp"

namespace mapcodec {

/// What the leaves of a tree hold (the ids are written to archives).
enum class OccupancyKind : std::uint8_t {
  binary = 1,    ///< occupied or free (.bt)
  log_odds = 2,  ///< a float32 (.ot of OcTree)
  color = 3,     ///< a float32 and a colour (.ot of ColorOcTree)
};
[[nodiscard]] constexpr const char* occupancy_name(OccupancyKind k) {
  constexpr const char* kNames[] = {"?", "binary", "log_odds", "color"};
  return kNames[static_cast<std::size_t>(k) <= 3 ? static_cast<std::size_t>(k) : 0];
}

/// Two bits of a child: nothing is known there, a leaf, or an inner node.
enum class Cell : std::uint8_t { unknown = 0, free = 1, occupied = 2, inner = 3 };

using OccupancyColor = std::array<std::uint8_t, 3>;       ///< red, green, blue
inline constexpr OccupancyColor kNoColor{255, 255, 255};  ///< OctoMap's "not set"
/// The comparison, without a call for three bytes.
[[nodiscard]] constexpr bool has_color(const OccupancyColor& c) {
  return (c[0] & c[1] & c[2]) != 255;
}
using CellCorner = std::array<std::uint32_t, 3>;  ///< x, y, z in voxels

inline constexpr unsigned kOccupancyHeight = 16;  ///< OctoMap's keys have 16 bits an axis, centre 32768

/// The inner nodes whose side is 2^h voxels, and the leaves of that side; each in Morton order (x lowest).
struct OccupancyLevel {
  /// Cell of child i in bits 2i, 2i + 1; child i lies at x + (i & 1), y + (i >> 1 & 1), z + (i >> 2). Never
  /// 0.
  std::vector<std::uint16_t> nodes;
  // Only of trees with log-odds: bits of the float32 of each leaf and each inner node. A leaf is `occupied`
  // if its value is not below 0.
  std::vector<std::uint32_t> leaf_values, node_values;
  // Only of trees with colours.
  std::vector<OccupancyColor> leaf_colors, node_colors;
  bool operator==(const OccupancyLevel&) const = default;
};

/// A tree or a subtree of one. Children of a level's nodes follow in order in the level below: the k-th inner
/// child of all is its node k, the k-th leaf its leaf k.
struct OccupancyTree {
  OccupancyKind kind = OccupancyKind::binary;
  std::uint8_t height = kOccupancyHeight;  ///< the root's side is 2^height voxels
  Cell root = Cell::unknown;               ///< unknown: the tree is empty
  std::array<OccupancyLevel, kOccupancyHeight + 1> levels;
  bool operator==(const OccupancyTree&) const = default;

  [[nodiscard]] std::uint64_t inner_count() const;
  [[nodiscard]] std::uint64_t leaf_count() const;
  [[nodiscard]] std::uint64_t leaf_count(Cell state) const;  ///< free or occupied
};

[[nodiscard]] constexpr Cell cell_of(std::uint32_t node, unsigned child) {
  return static_cast<Cell>(node >> (2 * child) & 3);
}
/// One bit (the even one of its pair) for each inner child.
[[nodiscard]] constexpr std::uint32_t inner_bits(std::uint32_t node) {
  return node & (node >> 1) & 0x5555;
}
/// The same for each leaf child.
[[nodiscard]] constexpr std::uint32_t leaf_bits(std::uint32_t node) {
  return (node ^ (node >> 1)) & 0x5555;
}
[[nodiscard]] constexpr CellCorner child_corner(const CellCorner& c, unsigned child, unsigned child_height) {
  return {c[0] + ((child & 1) << child_height), c[1] + ((child >> 1 & 1) << child_height),
          c[2] + ((child >> 2) << child_height)};
}

/// Of a leaf with this log-odds.
[[nodiscard]] constexpr Cell cell_of_value(std::uint32_t float_bits) {
  return std::bit_cast<float>(float_bits) < 0 ? Cell::free : Cell::occupied;
}

/// What OctoMap gives an inner node: the largest of its children's values, the mean of their colours.
/// Collect all children, then read.
class NodeSummary {
 public:
  void add(std::uint32_t value, const OccupancyColor& color) {
    const auto v = std::bit_cast<float>(value);
    if (v > largest_) largest_ = v;
    if (!has_color(color)) return;
    ++colored_;
    for (std::size_t d = 0; d < 3; ++d) sum_[d] += color[d];
  }
  [[nodiscard]] std::uint32_t value() const { return std::bit_cast<std::uint32_t>(largest_); }
  [[nodiscard]] OccupancyColor color() const {
    if (colored_ == 0) return kNoColor;
    return {static_cast<std::uint8_t>(sum_[0] / colored_), static_cast<std::uint8_t>(sum_[1] / colored_),
            static_cast<std::uint8_t>(sum_[2] / colored_)};
  }

 private:
  float largest_ = -3.402823466e+38f;
  std::array<std::uint32_t, 3> sum_{};
  std::uint32_t colored_ = 0;
};

/// Calls `f(height, i, summary)` for each inner node i of each level with what its children make of it, the
/// lowest level first; `f` may set the node's value, which its parent then sees. Nothing for binary trees.
template <class Tree, class F>
void summarise_nodes(Tree& tree, F&& f) {
  if (tree.kind == OccupancyKind::binary) return;
  for (unsigned h = 1; h <= tree.height; ++h) {
    const OccupancyLevel& below = tree.levels[h - 1];
    std::size_t leaf = 0, inner = 0;
    for (std::size_t i = 0; i < tree.levels[h].nodes.size(); ++i) {
      NodeSummary s;
      const std::uint32_t node = tree.levels[h].nodes[i];
      for (std::uint32_t left = (node | node >> 1) & 0x5555; left != 0; left &= left - 1) {
        const bool is_inner = (node >> std::countr_zero(left) & 3) == 3;
        const std::size_t k = is_inner ? inner++ : leaf++;
        const auto& colors = is_inner ? below.node_colors : below.leaf_colors;
        s.add((is_inner ? below.node_values : below.leaf_values)[k], colors.empty() ? kNoColor : colors[k]);
      }
      f(h, i, s);
    }
  }
}

/// Visits a tree depth first, children in order: `leaf(height, corner, cell, k)` and, before its children,
/// `node(height, corner, node, k)`; k counts within the level.
template <class Visitor>
class OccupancyWalk {
 public:
  OccupancyWalk(const OccupancyTree& tree, Visitor& visitor) : tree_(tree), visitor_(visitor) {}
  /// @param corner  of the root, in voxels.
  void run(const CellCorner& corner = {0, 0, 0}) { cell(tree_.root, tree_.height, corner); }

 private:
  void cell(Cell c, unsigned height, const CellCorner& corner) {
    if (c == Cell::unknown) return;
    if (c != Cell::inner) return visitor_.leaf(height, corner, c, leaf_[height]++);
    const std::size_t k = node_[height]++;
    const std::uint16_t node = tree_.levels[height].nodes[k];
    visitor_.node(height, corner, node, k);
    for (unsigned i = 0; i < 8; ++i) cell(cell_of(node, i), height - 1, child_corner(corner, i, height - 1));
  }

  const OccupancyTree& tree_;
  Visitor& visitor_;
  std::array<std::size_t, kOccupancyHeight + 1> leaf_{}, node_{};
};

template <class Visitor>
void walk(const OccupancyTree& tree, Visitor&& visitor, const CellCorner& corner = {0, 0, 0}) {
  OccupancyWalk<std::remove_reference_t<Visitor>>(tree, visitor).run(corner);
}

}  // namespace mapcodec
