// SPDX-License-Identifier: GPL-3.0-or-later
// Moments of any run of Morton-sorted points in constant time, and what they say about planes. Encoder only.
#pragma once

#include <span>
#include <vector>

#include "mapcodec/codec/surface_plane.hpp"

namespace mapcodec::surface {

using Units = std::array<std::int32_t, 3>;  ///< a point's unit cell, from the tile's base

/// First and second moments of n points about a cell's centre [units, units^2].
struct Moments {
  double n = 0;
  std::array<double, 3> first{};
  std::array<double, 6> second{};  ///< xx, yy, zz, xy, xz, yz
  [[nodiscard]] double product(unsigned d, unsigned e) const {
    return d == e ? second[d] : second[d + e + 2];
  }
};

class MomentTable {
 public:
  explicit MomentTable(std::span<const Units> points);
  /// Of points [begin, end) about `twice_center` / 2.
  [[nodiscard]] Moments about(std::size_t begin, std::size_t end, const Units& twice_center) const;

 private:
  using Sums = std::array<std::int64_t, 9>;
  std::vector<Sums> before_;  // sums over the points before each
};

/// Best plane of the points in a cell on the parameters' lattice: of the three axes the one with the least
/// squared distances, but `wanted_axis` (3: none) if it is nearly as good. False where no plane can be told.
[[nodiscard]] bool fit_plane(const Moments& m, const CellShape& shape, unsigned wanted_axis, Plane& plane);

/// Sum of squared distances to a plane [units^2].
[[nodiscard]] double squared_distances(const Moments& m, const CellShape& shape, const Plane& plane);

/// Slopes of a plane (rise per unit along its two axes).
struct Slopes {
  double a, b, h;  ///< h: height at the centre [units]
  /// True area per area seen along the plane's axis, squared.
  [[nodiscard]] double stretch_squared() const { return 1 + a * a + b * b; }
};
[[nodiscard]] Slopes slopes_of(const Plane& plane, const CellShape& shape);

}  // namespace mapcodec::surface
