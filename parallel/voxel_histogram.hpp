// SPDX-License-Identifier: GPL-3.0-or-later
// Where the points of a map are, in bounded memory, however large the map.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// Farthest coordinate [m] that has a place in a map; beyond it a point counts as one without position.
inline constexpr double kMaxCoordinate = 8589934592.0;  // 2^33

/// Finite, and no farther than kMaxCoordinate on any axis.
[[nodiscard]] inline bool has_place(const Vec3& p) {
  return std::abs(p[0]) <= kMaxCoordinate && std::abs(p[1]) <= kMaxCoordinate &&
         std::abs(p[2]) <= kMaxCoordinate;
}

/// Index of a lattice cell; each axis in [-2^30, 2^30).
struct CellIndex {
  std::int32_t x = 0, y = 0, z = 0;
  bool operator==(const CellIndex&) const = default;
};

/// Points per cubic cell of 2^exponent metres, cells at multiples of their side from `origin`. When more than
/// `max_cells` are occupied (or a point is too far for an index), the cell doubles. The final cell is
/// therefore the smallest that does, whatever the order of the points and however the work was divided among
/// histograms that were merged.
class VoxelHistogram {
 public:
  static constexpr std::size_t kMaxCells = std::size_t{1} << 18;
  static constexpr int kMinExponent = -10;  ///< 1/1024 m

  struct Cell {
    CellIndex index;
    std::uint32_t points = 0;  ///< stays at 2^32 - 1
  };

  VoxelHistogram() = default;
  /// @param origin    [m] a multiple of 1024 m, so that it is exact.
  /// @param exponent  log2 of the first cell side [m].
  VoxelHistogram(const Vec3& origin, int exponent, std::size_t max_cells = kMaxCells);

  /// Counts `p`, for which has_place(p) holds.
  void add(const Vec3& p);
  /// Adds the counts of `other`, which has the same origin and max_cells.
  void merge(const VoxelHistogram& other);

  [[nodiscard]] const Vec3& origin() const { return origin_; }
  [[nodiscard]] int exponent() const { return exponent_; }
  [[nodiscard]] double cell_m() const { return std::ldexp(1.0, exponent_); }
  [[nodiscard]] std::size_t occupied() const { return occupied_; }
  /// The occupied cells, in no particular order.
  [[nodiscard]] std::vector<Cell> cells() const;

 private:
  void count(const CellIndex& c, std::uint32_t points);
  void rebuild(std::size_t slots, int shift);
  void coarsen() { rebuild(slots_.size(), 1); }
  [[nodiscard]] std::size_t find(const CellIndex& c) const;

  Vec3 origin_{0, 0, 0};
  int exponent_ = 0;
  double per_m_ = 1;
  std::size_t max_cells_ = kMaxCells;
  std::vector<Cell> slots_;  // open addressing; points == 0: free
  std::size_t occupied_ = 0;
  std::size_t last_ = 0;  // slot of the last point: neighbours in a file are often neighbours in space
};

/// floor(v) for |v| < 2^31, without the library call that std::floor is on plain x86-64.
[[nodiscard]] inline std::int32_t floor_to_int(double v) {
  const auto i = static_cast<std::int32_t>(v);
  return i - static_cast<std::int32_t>(v < i);
}

}  // namespace mapcodec
