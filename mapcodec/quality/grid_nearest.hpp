// SPDX-License-Identifier: GPL-3.0-or-later
// Exact nearest neighbours among the points of one tile, several times faster than by a k-d tree when queries
// come in spatial order and lie about as far from the points as these from each other.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "mapcodec/quality/nearest.hpp"

namespace mapcodec {

/// Points sorted into the cells of a cubic grid whose cells are about as wide as the points' spacing. Const
/// methods may be called from many threads.
class GridNearest {
 public:
  /// @param points  finite, not empty, fewer than 2^32; need not outlive the grid.
  explicit GridNearest(std::span<const Vec3> points);
  ~GridNearest();
  GridNearest(GridNearest&&) noexcept;
  GridNearest& operator=(GridNearest&&) noexcept;

  /// The points' indices cell by cell, in Morton order of the cells: a good order to ask in.
  [[nodiscard]] std::span<const std::uint32_t> order() const;

  /// For each of `from` its nearest point here, as find_nearest gives (of equally near ones always the same).
  /// @param order  in which to ask: all of `from`.
  [[nodiscard]] Nearest find(std::span<const Vec3> from, std::span<const std::uint32_t> order) const;
  /// Mean squared distance [m^2] of every `every`-th of `from` in that order.
  [[nodiscard]] double mean_squared(std::span<const Vec3> from, std::span<const std::uint32_t> order,
                                    std::size_t every) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Both directions between two clouds.
struct NearestPair {
  Nearest forth;  ///< of each point of the first its nearest in the second
  Nearest back;   ///< the other way
};
/// @param a, b  as for GridNearest.
[[nodiscard]] NearestPair find_nearest_pair(std::span<const Vec3> a, std::span<const Vec3> b);

/// Mean squared distances [m^2] both ways, from a part of the points: within about 1 % of the exact ones'
/// root for 10,000 points.
struct RoughErrors {
  double forth, back;
};
/// @param a, b  as for GridNearest.
[[nodiscard]] RoughErrors estimate_errors(std::span<const Vec3> a, std::span<const Vec3> b);

}  // namespace mapcodec
