// SPDX-License-Identifier: GPL-3.0-or-later
// What the voxels of blocks would lose. Encoder only.
#pragma once

#include <optional>

#include "mapcodec/codec/surface_blocks.hpp"
#include "mapcodec/codec/surface_errors.hpp"

namespace mapcodec::surface {

/// Squared errors of the occupied voxels of a tile, if they were in blocks. Each is found when first asked
/// for.
class VoxelErrors {
 public:
  using ByNoise = std::array<double, kMostNoise + 1>;

  VoxelErrors() = default;
  /// @param points  must outlive this. @param v  log2 of a voxel's side [units].
  /// @param forward_weight  of the errors' first direction.
  VoxelErrors(std::span<const Units> points, int v, double forward_weight, double lambda);

  /// Occupied voxels in a cell that is not smaller than one.
  [[nodiscard]] std::uint32_t count_in(const TreeCell& cell) const;
  /// Weighted squared errors of the cell's voxels for each thickness. @param errors  of the same points.
  [[nodiscard]] ByNoise errors_in(const TreeCell& cell, LeafErrors& errors);

 private:
  [[nodiscard]] std::size_t index_of(std::size_t point) const;
  void measure(std::size_t voxel, LeafErrors& errors);

  std::span<const Units> points_;
  int v_ = 0;
  double forward_ = 0, lambda_ = 0;
  std::vector<std::size_t> begin_;  ///< first point of each voxel, and their end
  std::optional<VoxelSet> set_;     ///< built with the first voxel that is measured
  struct Voxel {
    bool known = false;
    std::array<float, kMostNoise + 1> errors{};
  };
  std::vector<Voxel> voxels_;
};

}  // namespace mapcodec::surface
