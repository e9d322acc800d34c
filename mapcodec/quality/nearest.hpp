// SPDX-License-Identifier: GPL-3.0-or-later
// Nearest neighbours between two clouds: what all distance measures are made of.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mapcodec/base/runner.hpp"
#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// A k-d tree over points. Const methods may be called from many threads.
class NeighborIndex {
 public:
  /// @param points  finite, not empty, fewer than 2^32; must outlive the index.
  explicit NeighborIndex(std::span<const Vec3> points);
  ~NeighborIndex();
  NeighborIndex(NeighborIndex&&) noexcept;
  NeighborIndex& operator=(NeighborIndex&&) noexcept;

  /// The nearest point's index; `squared` is its squared distance. Of equally near ones always the same.
  [[nodiscard]] std::uint32_t nearest(const Vec3& query, double& squared) const;
  /// The `ids.size()` nearest, nearest first; returns how many there are.
  std::size_t nearest(const Vec3& query, std::span<std::uint32_t> ids, std::span<double> squared) const;
  /// Indices of all points within `radius_m` (Euclidean), in no order.
  [[nodiscard]] std::vector<std::uint32_t> within(const Vec3& query, double radius_m) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// For each point of one cloud its nearest one in the other.
struct Nearest {
  std::vector<std::uint32_t> index;
  std::vector<double> squared;  ///< squared distance [m^2]
};
[[nodiscard]] Nearest find_nearest(std::span<const Vec3> from, const NeighborIndex& to, Runner& runner);

/// Sums and extremes of one direction.
struct DistanceStats {
  double mean_squared = 0, max_m = 0;
};
[[nodiscard]] DistanceStats summarise(std::span<const Vec3> from, const Nearest& nearest);

/// The largest distance in the maximum norm [m] of a point of `from` to its nearest in that norm: what a
/// bound on the error along each axis promises. The Euclidean neighbours in `nearest` only narrow the search,
/// since of two neighbours the nearer one can be farther along one axis.
[[nodiscard]] double max_axis_error(std::span<const Vec3> from, std::span<const Vec3> to,
                                    const NeighborIndex& index, const Nearest& nearest);

}  // namespace mapcodec
