// SPDX-License-Identifier: GPL-3.0-or-later
// What the voxels of blocks would lose. Encoder only.
#pragma once

#include "mapcodec/codec/surface_errors.hpp"

namespace mapcodec::surface {

/// Squared errors of all occupied voxels of a tile, if they were in blocks; sums over any cell in constant
/// time.
class VoxelErrors {
 public:
  VoxelErrors() = default;
  /// @param v  log2 of a voxel's side [units]. @param forward_weight  of the errors' first direction.
  VoxelErrors(std::span<const Units> points, int v, LeafErrors& errors, double forward_weight, double lambda);

  /// Occupied voxels in a cell that is not smaller than one.
  [[nodiscard]] std::uint32_t count_in(const TreeCell& cell) const;
  /// Weighted squared error of the cell's voxels with this thickness (0..kMostNoise).
  [[nodiscard]] double error_in(const TreeCell& cell, std::uint8_t noise) const;

 private:
  [[nodiscard]] std::size_t index_of(std::size_t point) const;

  std::vector<std::size_t> begin_;                        ///< first point of each voxel, and their end
  std::array<std::vector<double>, kMostNoise + 1> sums_;  ///< over the voxels before each
};

}  // namespace mapcodec::surface
