// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/color_tree.hpp"

#include <algorithm>
#include <bit>

#include "mapcodec/geometry/morton.hpp"
#include "mapcodec/geometry/octants.hpp"

namespace mapcodec {
namespace {

/// [l]: neighbouring points that part in cells of 2^(l-1) voxels, but not of 2^l; [0]: that share a voxel.
using Splits = std::array<std::size_t, kMortonBits + 1>;

Splits count_splits(std::span<const VoxelCoord> voxels) {
  Splits splits{};
  for (std::size_t i = 1; i < voxels.size(); ++i) {
    const VoxelCoord &a = voxels[i - 1], &b = voxels[i];
    const std::uint32_t differ = (a[0] ^ b[0]) | (a[1] ^ b[1]) | (a[2] ^ b[2]);
    ++splits[std::min<std::size_t>(static_cast<std::size_t>(std::bit_width(differ)), kMortonBits)];
  }
  return splits;
}

/// The coarsest cells (in powers of two of voxels) that still keep nearly all voxels apart, and how many they
/// are: finer levels would only hand single points down.
std::pair<std::uint32_t, std::size_t> finest_cells(const Splits& splits, std::size_t points) {
  const std::size_t whole = points - splits[0];
  std::size_t cells = whole;
  std::uint32_t shift = 0;
  while (shift < kMortonBits && 16 * (cells - splits[shift + 1]) >= 15 * whole) cells -= splits[++shift];
  return {shift, cells};
}

std::uint32_t child_of(const ColorLevel& level, std::uint32_t node, std::uint32_t octant) {
  if (node == kNoNode) return kNoNode;
  const ColorNode& n = level.nodes[node];
  if (((n.mask >> octant) & 1) == 0) return kNoNode;
  return n.child + kOctantRank[n.mask][octant] - 1;
}

/// Calls f(node, octant, child) for all children of a level's nodes, in the order of the level below.
template <class F>
void for_each_child(const ColorLevel& level, F&& f) {
  for (std::uint32_t n = 0; n < level.size(); ++n) {
    std::uint32_t child = level.nodes[n].child;
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      if (((level.nodes[n].mask >> octant) & 1) != 0) f(n, octant, child++);
    }
  }
}

void link_faces(ColorLevel& level, const ColorLevel& parent) {
  level.faces.resize(level.size());
  for_each_child(parent, [&](std::uint32_t p, std::uint32_t octant, std::uint32_t child) {
    FaceNodes& faces = level.faces[child];
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t high = (octant >> axis) & 1, mirrored = octant ^ (1u << axis);
      faces[2 * axis + (high ^ 1)] = child_of(parent, p, mirrored);
      faces[2 * axis + high] = child_of(parent, parent.faces[p][2 * axis + high], mirrored);
    }
  });
}

void link_edges(ColorLevel& level, const ColorLevel& parent) {
  level.edges.resize(level.size());
  for_each_child(parent, [&](std::uint32_t p, std::uint32_t octant, std::uint32_t child) {
    EdgeNodes& edges = level.edges[child];
    const FaceNodes& faces = parent.faces[p];
    for (std::uint32_t pair = 0; pair < 3; ++pair) {
      const auto [u, v] = kEdgeAxes[pair];
      const std::uint32_t high_u = (octant >> u) & 1, high_v = (octant >> v) & 1;
      for (std::uint32_t side = 0; side < 4; ++side) {
        const std::uint32_t side_u = side & 1, side_v = side >> 1;
        // The parent that the neighbour is in: beyond an edge, a face or none of this one.
        const std::uint32_t cell = side_u == high_u && side_v == high_v ? parent.edges[p][4 * pair + side]
                                   : side_u == high_u                   ? faces[2 * u + side_u]
                                   : side_v == high_v                   ? faces[2 * v + side_v]
                                                                        : p;
        edges[4 * pair + side] = child_of(parent, cell, octant ^ (1u << u) ^ (1u << v));
      }
    }
  });
}

}  // namespace

std::uint64_t ColorTree::count_nodes(std::span<const VoxelCoord> voxels) {
  const Splits splits = count_splits(voxels);
  auto [shift, cells] = finest_cells(splits, voxels.size());
  std::uint64_t nodes = cells;
  while (shift < kMortonBits) nodes += cells -= splits[++shift];
  return nodes;
}

ColorTree::ColorTree(std::span<const VoxelCoord> voxels, bool edges)
    : points_(static_cast<std::uint32_t>(voxels.size())) {
  build_levels(voxels);
  ColorLevel& root = levels_.front();
  root.faces.resize(1);
  root.faces.front().fill(kNoNode);
  if (edges) root.edges.resize(1);
  if (edges) root.edges.front().fill(kNoNode);
  for (std::size_t l = 1; l + 1 < levels_.size(); ++l) {
    link_faces(levels_[l], levels_[l - 1]);
    if (edges) link_edges(levels_[l], levels_[l - 1]);
  }
}

void ColorTree::build_levels(std::span<const VoxelCoord> voxels) {
  std::vector<std::uint64_t> keys;
  keys.reserve(voxels.size());
  for (const VoxelCoord& v : voxels) keys.push_back(morton_encode(v));
  const std::uint32_t shift = 3 * finest_cells(count_splits(voxels), voxels.size()).first;
  ColorLevel level;
  level.nodes.reserve(voxels.size() + 1);
  std::vector<std::uint64_t> cells;
  cells.reserve(voxels.size());
  for (std::uint32_t i = 0; i < points_; ++i) {
    const std::uint64_t cell = keys[i] >> shift;
    if (!cells.empty() && cells.back() == cell) continue;
    cells.push_back(cell);
    level.nodes.push_back({i, 0, 0});
  }
  level.nodes.push_back({points_, 0, 0});
  levels_.push_back(std::move(level));
  while (cells.size() > 1) {
    const ColorLevel& below = levels_.back();
    ColorLevel above;
    std::size_t parents = 0;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      const std::uint64_t cell = cells[c] >> 3;
      const auto octant = static_cast<std::uint32_t>(cells[c] & 7);
      if (parents == 0 || cells[parents - 1] != cell) {
        cells[parents++] = cell;
        above.nodes.push_back({below.nodes[c].begin, static_cast<std::uint32_t>(c), 0});
      }
      above.nodes.back().mask |= static_cast<std::uint8_t>(1u << octant);
    }
    above.nodes.push_back({points_, static_cast<std::uint32_t>(cells.size()), 0});
    cells.resize(parents);
    levels_.push_back(std::move(above));
  }
  std::reverse(levels_.begin(), levels_.end());
}

}  // namespace mapcodec
