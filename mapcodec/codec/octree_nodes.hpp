// SPDX-License-Identifier: GPL-3.0-or-later
// The nodes of one octree level with their face neighbours. Neighbours are found from the parents'
// neighbours: no hash, no search. Shared by encoder and decoder.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec::octree {

/// Children of an octet are numbered x + 2 y + 4 z of their halves (0 low, 1 high); bit i of a mask is child
/// i.
inline constexpr std::array<std::array<std::uint8_t, 2>, 3> kHalfMask{
    {{0x55, 0xaa}, {0x33, 0xcc}, {0x0f, 0xf0}}};

inline constexpr std::array<std::uint8_t, 256> kPopCount = [] {
  std::array<std::uint8_t, 256> t{};
  for (std::size_t m = 1; m < 256; ++m) t[m] = static_cast<std::uint8_t>(t[m >> 1] + (m & 1));
  return t;
}();

/// What the next level needs of a node. A mask of 0 means: not coded yet, or no node.
struct Link {
  std::uint32_t first_child = 0;  ///< index in the next level
  std::uint32_t mask = 0;         ///< occupied children
};

struct Node {
  VoxelCoord at{0, 0, 0};  ///< in units of this level's cells
  std::array<std::uint32_t, 6>
      beside{};               ///< index in this level of the neighbour at -x, +x, -y, +y, -z, +z; 0: none
  std::uint8_t siblings = 0;  ///< children of its parent, 0 for the root
  bool single = false;        ///< known to hold exactly one voxel
};

/// Index of child `i` of `parent`, or 0 if it has none.
[[nodiscard]] inline std::uint32_t child_index(const Link& parent, std::uint32_t i) {
  const std::uint32_t bit = 1u << i;
  const std::uint32_t at = parent.first_child + kPopCount[parent.mask & (bit - 1)];
  return (parent.mask & bit) != 0 ? at : 0;
}

/// Nodes in Morton order from index 1 on; index 0 is nobody.
struct Level {
  std::vector<Node> nodes;
  std::vector<Link> links;

  /// The root alone.
  void make_root() {
    nodes.assign(2, Node{});
    links.assign(2, Link{});
  }
  /// Room for `count` nodes, none there yet.
  void reset(std::size_t count) {
    nodes.clear();
    nodes.reserve(count + 1);
    nodes.push_back(Node{});
    links.assign(count + 1, Link{});
  }
  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(nodes.size()); }

  /// Appends the children of node `p` of `parents`, whose links are complete.
  void append_children(const Level& parents, std::uint32_t p) {
    const Node& parent = parents.nodes[p];
    const Link& own = parents.links[p];
    const bool lonely = is_lonely(parent) && (own.mask & (own.mask - 1)) == 0;
    for (std::uint32_t left = own.mask; left != 0; left &= left - 1) {
      const auto i = static_cast<std::uint32_t>(std::countr_zero(left));
      Node& child = nodes.emplace_back();
      child.siblings = kPopCount[own.mask];
      child.single = parent.single;
      for (std::uint32_t axis = 0; axis < 3; ++axis) child.at[axis] = 2 * parent.at[axis] + (i >> axis & 1);
      if (!lonely) find_neighbours(parents, p, i, child);
    }
  }

 private:
  static bool is_lonely(const Node& node) {
    const auto& b = node.beside;
    return (b[0] | b[1] | b[2] | b[3] | b[4] | b[5]) == 0;
  }

  // Across each axis one neighbour is a sibling, the other a child of the parent's neighbour.
  static void find_neighbours(const Level& parents, std::uint32_t p, std::uint32_t i, Node& child) {
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t high = i >> axis & 1;
      const std::uint32_t mirrored = i ^ (1u << axis);
      const std::uint32_t outer = parents.nodes[p].beside[2 * axis + high];
      child.beside[2 * axis + (high ^ 1)] = child_index(parents.links[p], mirrored);
      child.beside[2 * axis + high] = child_index(parents.links[outer], mirrored);
    }
  }
};

}  // namespace mapcodec::octree
