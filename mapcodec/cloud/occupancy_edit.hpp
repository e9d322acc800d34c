// SPDX-License-Identifier: GPL-3.0-or-later
// Octrees looked into at any place, laid over one another, and clipped.
#pragma once

#include <functional>
#include <optional>

#include "mapcodec/cloud/occupancy_tree.hpp"

namespace mapcodec {

/// A cell of a tree: what it is and where its data lies.
struct OccupancyCell {
  Cell cell = Cell::unknown;
  std::uint8_t height = 0;
  std::size_t index = 0;  ///< in its level, among the leaves or the inner nodes
};

/// Finds the children of any node. Refers to the tree, which must not change.
class OccupancyIndex {
 public:
  explicit OccupancyIndex(const OccupancyTree& tree);

  [[nodiscard]] const OccupancyTree& tree() const { return *tree_; }
  [[nodiscard]] OccupancyCell root() const { return {tree_->root, tree_->height, 0}; }
  /// @param parent  an inner one.
  [[nodiscard]] OccupancyCell child(const OccupancyCell& parent, unsigned child) const;
  /// The smallest cell of the tree that contains the voxel; unknown if nothing is known there.
  [[nodiscard]] OccupancyCell find(const CellCorner& voxel) const;
  /// What lies below a cell, as a tree.
  [[nodiscard]] OccupancyTree subtree(const OccupancyCell& cell) const;

  [[nodiscard]] std::uint32_t value(const OccupancyCell& leaf) const;   ///< 0 for a binary tree
  [[nodiscard]] OccupancyColor color(const OccupancyCell& leaf) const;  ///< kNoColor without colours

 private:
  struct First {
    std::uint32_t inner, leaf;
  };
  const OccupancyTree* tree_;
  std::array<std::vector<First>, kOccupancyHeight + 1> first_;  ///< children of each node
};

/// `base` where `top` knows nothing, else `top`. Both of one height and kind. Eight equal leaves of which not
/// all come from `top` become one, as in OctoMap; inner nodes above changes are what their children make of
/// them.
[[nodiscard]] OccupancyTree overlay(const OccupancyTree& base, const OccupancyTree& top);

/// The leaves for whose cubes `keep(corner, height)` holds; it must hold for a cube if it does for a part of
/// it. Inner nodes are what their children make of them.
[[nodiscard]] OccupancyTree clip(const OccupancyTree& tree, const CellCorner& corner,
                                 const std::function<bool(const CellCorner&, unsigned)>& keep);

/// The cells alone: a binary tree.
[[nodiscard]] OccupancyTree to_binary(const OccupancyTree& tree);

}  // namespace mapcodec
