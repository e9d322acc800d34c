// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <span>
#include <vector>

#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// For points visited in decoded order, the nearest of those visited before. Points are binned into cells of
/// a power of two of voxels that hold about two points; looked at are the last points of the point's own
/// cell, up to three points of each of the 26 cells around it that was begun earlier, and the last point of
/// all. Integers only: encoder and decoder find the same. Threads: one object, one thread.
class CausalNeighbors {
 public:
  static constexpr std::size_t kMost = 6;
  struct Neighbor {
    std::uint32_t index = 0;
    std::uint64_t squared_distance = 0;  ///< in voxels
  };

  /// @param voxels  Morton-sorted, each coordinate below 2^21; must outlive this object.
  explicit CausalNeighbors(std::span<const VoxelCoord> voxels);

  /// Neighbours of point `i`, nearest first (ties: found first). Call for i = 0, 1, 2, ... in turn.
  [[nodiscard]] std::span<const Neighbor> find(std::uint32_t i);

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t cell = 0;  ///< ordinal + 1; 0: free
  };

  void choose_cell_size();
  [[nodiscard]] VoxelCoord cell_of(std::uint32_t i) const;
  void begin_cell(std::uint32_t i);
  void add_candidates(std::uint32_t cell);
  void insert(std::uint64_t key, std::uint32_t cell);
  [[nodiscard]] std::uint32_t look_up(std::uint64_t key) const;
  void offer(std::uint32_t i, std::uint32_t candidate);

  std::span<const VoxelCoord> voxels_;
  std::uint32_t shift_ = 0;
  std::size_t mask_ = 0;
  std::vector<Slot> table_;
  std::vector<std::uint32_t> cell_begin_;
  std::array<std::uint32_t, 26 * 3> candidates_{};
  std::size_t candidate_count_ = 0;
  std::array<Neighbor, kMost> found_{};
  std::size_t found_count_ = 0;
};

}  // namespace mapcodec
