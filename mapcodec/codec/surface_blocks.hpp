// SPDX-License-Identifier: GPL-3.0-or-later
// Voxels of a surface tree: the surface through them is not sent but fitted (FORMAT.md 10.6).
#pragma once

#include <span>

#include "mapcodec/codec/surface_points.hpp"

namespace mapcodec::surface {

/// Occupied voxels, for lookups around one.
class VoxelSet {
 public:
  /// @param v  log2 of a voxel's side [units].
  explicit VoxelSet(int v) : v_(v) {}
  void reserve(std::size_t count);
  void insert(const std::array<std::uint32_t, 3>& at);  ///< lowest corner [units]
  /// Plane through the centres of the occupied voxels within two voxels of the one at `at`.
  [[nodiscard]] Plane fit(const std::array<std::uint32_t, 3>& at) const;

 private:
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};
  [[nodiscard]] std::uint64_t cells_of(std::uint64_t key) const;

  struct Cube {  ///< four voxels a side
    std::uint64_t key = kFree, cells = 0;
  };
  int v_;
  std::vector<Cube> table_;
};

/// Gives the voxels among `leaves` their planes, and their share of the points of their blocks.
/// @param others  points of all other leaves: the surface goes on there.
void settle_blocks(std::vector<Leaf>& leaves, std::span<const Block> blocks, int v,
                   std::span<const SubUnits> others);

/// Points of all leaves: first those of the cells, in order, then those of the voxels.
[[nodiscard]] std::vector<SubUnits> spread_leaves(std::vector<Leaf>& leaves, std::span<const Block> blocks,
                                                  int v, std::size_t count, const Surroundings& around);

}  // namespace mapcodec::surface
