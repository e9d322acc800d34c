// SPDX-License-Identifier: GPL-3.0-or-later
// How the density of points changes over a leaf, judged by the leaves beside it (FORMAT.md 10.5).
#pragma once

#include <span>
#include <vector>

#include "mapcodec/codec/surface_walk.hpp"

namespace mapcodec::surface {

inline constexpr std::uint32_t kLeastTilted = 16;  ///< points of leaves whose density changes

class DensityTable {
 public:
  /// Both must outlive it.
  DensityTable(std::span<const Leaf> leaves, const Outline& outline);
  /// Notes a leaf `to` with the same axis beyond a face of `from` across its plane.
  /// @param seam  number of `from`'s seam: 0, 1, 2, ... as they appear.
  void add_beside(std::size_t seam, std::int32_t from, std::int32_t to, unsigned face);
  [[nodiscard]] Tilt tilt_of(std::size_t seam);

 private:
  /// What lies beyond one face.
  struct Beyond {
    std::uint64_t points = 0, area = 0;
    std::uint64_t sides = 0;  ///< of the leaves along the face's axis [units]
    std::uint64_t leaves = 0;
  };
  struct Entry {
    std::int32_t leaf = -1;
    std::array<Beyond, 4> beyond;  ///< at the lower and upper faces along u, then v
  };
  [[nodiscard]] std::uint64_t area_of(std::int32_t leaf);
  [[nodiscard]] bool rise_to(std::int32_t leaf, const Beyond& beyond, unsigned axis, std::int64_t& rise);

  std::span<const Leaf> leaves_;
  const Outline& outline_;
  std::vector<std::uint64_t> areas_;  ///< of leaves, one more; 0: not known yet
  std::vector<Entry> entries_;
};

}  // namespace mapcodec::surface
