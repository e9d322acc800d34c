// SPDX-License-Identifier: GPL-3.0-or-later
// The hierarchy that colours are transformed over: octree levels above the points, then halvings of the
// points that share a finest cell (FORMAT.md 8.5).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

inline constexpr std::uint32_t kNoNode = ~std::uint32_t{0};

/// A cell: points [begin, the next node's begin).
struct ColorNode {
  std::uint32_t begin = 0;
  std::uint32_t child = 0;  ///< index of its first child in the level below
  std::uint8_t mask = 0;    ///< octants that hold points
};

/// Nodes of the same level across a cell's faces -x, +x, -y, +y, -z, +z, or kNoNode.
using FaceNodes = std::array<std::uint32_t, 6>;
/// Nodes across a cell's edges, or kNoNode: four for each pair of axes (x y, x z, y z), low low, high low,
/// low high, high high.
using EdgeNodes = std::array<std::uint32_t, 12>;
/// The axes of a pair.
inline constexpr std::array<std::array<std::uint32_t, 2>, 3> kEdgeAxes{{{0, 1}, {0, 2}, {1, 2}}};

/// One level, nodes in Morton order; the last entry is a sentinel, of which only `begin` and `child` mean
/// something.
struct ColorLevel {
  std::vector<ColorNode> nodes;
  // By the node. Finest cells are not split any more: nobody asks what is around them, and both are empty.
  std::vector<FaceNodes> faces;
  std::vector<EdgeNodes> edges;  ///< only if the tree has them
  [[nodiscard]] std::size_t size() const { return nodes.size() - 1; }
  [[nodiscard]] std::uint32_t weight(std::size_t n) const { return nodes[n + 1].begin - nodes[n].begin; }
};

class ColorTree {
 public:
  /// Nodes of all levels that a tree over these voxels would have, without building it.
  [[nodiscard]] static std::uint64_t count_nodes(std::span<const VoxelCoord> voxels);

  /// @param voxels  Morton-sorted (equal ones adjacent), not empty, coordinates below 2^21.
  /// @param edges  whether neighbours across edges are wanted beside those across faces.
  ColorTree(std::span<const VoxelCoord> voxels, bool edges);

  /// levels()[0] is the root alone; the last one holds the finest cells.
  [[nodiscard]] const std::vector<ColorLevel>& levels() const { return levels_; }
  [[nodiscard]] std::uint32_t points() const { return points_; }

 private:
  void build_levels(std::span<const VoxelCoord> voxels);

  std::uint32_t points_;
  std::vector<ColorLevel> levels_;
};

}  // namespace mapcodec
