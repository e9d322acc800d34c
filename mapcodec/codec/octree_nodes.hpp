// SPDX-License-Identifier: GPL-3.0-or-later
// The nodes of one octree level with their face neighbours. Neighbours are found from the parents'
// neighbours: no hash, no search. Shared by encoder and decoder.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <memory>

#include "mapcodec/geometry/octants.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec::octree {

/// Children of an octet are numbered x + 2 y + 4 z of their halves (0 low, 1 high); bit i of a mask is child
/// i.
inline constexpr std::array<std::array<std::uint8_t, 2>, 3> kHalfMask{
    {{0x55, 0xaa}, {0x33, 0xcc}, {0x0f, 0xf0}}};

/// What the next level needs of a node. A mask of 0 means: no node.
struct Link {
  std::uint32_t before_first;  ///< index in the next level of its first child, less 1
  std::uint32_t mask;          ///< occupied children
};

struct Node {
  VoxelCoord at;  ///< in units of this level's cells
  /// Index in this level of the neighbour at -x, +x, -y, +y, -z, +z; 0: none.
  std::array<std::uint32_t, 6> beside;
  std::uint8_t siblings;  ///< children of its parent, 0 for the root
  bool single;            ///< known to hold exactly one voxel
};

/// Index of child `i` of `parent`, or 0 if it has none.
[[nodiscard]] inline std::uint32_t child_index(const Link& parent, std::uint32_t i) {
  const std::uint32_t rank = kOctantRank[parent.mask][i];
  const std::uint32_t at = parent.before_first + rank;
  return rank != 0 ? at : 0;
}

/// Nodes in Morton order from index 1 on; index 0 is nobody. What lies past size() means nothing.
struct Level {
  std::unique_ptr<Node[]> nodes;
  std::unique_ptr<Link[]> links;

  /// The root alone.
  void make_root() {
    reset(1);
    nodes[size_++] = Node{};
  }
  /// Room for `count` nodes, none there yet.
  void reset(std::size_t count) {
    if (room_ <= count) {
      room_ = count + 1;
      nodes = std::make_unique_for_overwrite<Node[]>(room_);
      links = std::make_unique_for_overwrite<Link[]>(room_);
    }
    nodes[0] = Node{};
    links[0] = Link{};
    size_ = 1;
  }
  [[nodiscard]] std::uint32_t size() const { return size_; }

  /// Makes this the `count` children of `parents`, whose links are complete.
  void append_level(const Level& parents, std::size_t count) {
    reset(count);
    for (std::uint32_t p = 1; p < parents.size(); ++p) {
      for (std::uint32_t left = parents.links[p].mask; left != 0; left &= left - 1) {
        append_child(parents, p, static_cast<std::uint32_t>(std::countr_zero(left)));
      }
    }
  }

  /// Appends child `i` of node `p` of `parents`, whose links are complete.
  /// @return its index.
  std::uint32_t append_child(const Level& parents, std::uint32_t p, std::uint32_t i) {
    const Node& parent = parents.nodes[p];
    const Link own = parents.links[p];
    Node& child = nodes[size_];
    child.siblings = kOctantCount[own.mask];
    child.single = parent.single;
    for (std::uint32_t axis = 0; axis < 3; ++axis) child.at[axis] = 2 * parent.at[axis] + (i >> axis & 1);
    find_neighbours(parents, parent, own, i, child);
    return size_++;
  }

 private:
  // Across each axis one neighbour is a sibling, the other a child of the parent's neighbour.
  static void find_neighbours(const Level& parents, const Node& parent, const Link& own, std::uint32_t i,
                              Node& child) {
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t high = i >> axis & 1;
      const std::uint32_t mirrored = i ^ (1u << axis);
      const std::uint32_t outer = parent.beside[2 * axis + high];
      child.beside[2 * axis + (high ^ 1)] = child_index(own, mirrored);
      child.beside[2 * axis + high] = child_index(parents.links[outer], mirrored);
    }
  }

  std::uint32_t size_ = 0;
  std::size_t room_ = 0;
};

}  // namespace mapcodec::octree
