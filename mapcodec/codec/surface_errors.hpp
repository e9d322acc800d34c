// SPDX-License-Identifier: GPL-3.0-or-later
// What a leaf of the surface tree would lose, in both directions: from the original points to the decoded
// ones, and back. Encoder only.
#pragma once

#include "mapcodec/codec/surface_cell.hpp"
#include "mapcodec/codec/surface_coverage.hpp"
#include "mapcodec/codec/surface_polygon.hpp"

namespace mapcodec::surface {

/// Sums of squared distances [units^2] over a leaf's points.
struct LeafError {
  double forth = kNever;                               ///< original to decoded
  double back = kNever;                                ///< decoded to original
  double beside_forth = kNever, beside_back = kNever;  ///< of them, what dividing could save
};

class LeafErrors {
 public:
  /// Leaves of up to this many points are decoded and compared; larger ones are estimated from moments and
  /// probes.
  static constexpr std::uint32_t kFew = 16;
  static constexpr std::uint32_t kFewProbes = 16, kManyProbes = 64;

  LeafErrors(std::span<const Units> points, unsigned depth)
      : points_(points), moments_(points), coverage_(points, depth) {}

  [[nodiscard]] Moments moments(const TreeCell& cell) const {
    return moments_.about(cell.begin, cell.end, cell.twice_center());
  }
  /// All points at the cell's centre.
  [[nodiscard]] LeafError at_center(const TreeCell& cell, const Moments& m) const;
  /// One point, on the plane if there is one [units^2]. @param polygon  of the plane.
  [[nodiscard]] double of_single(const TreeCell& cell, const Plane* plane, const Polygon& polygon);
  /// Spreads the points of a cell of at most kFew over its polygon, for of_few().
  void decode_few(const TreeCell& cell, const Plane& plane, const Polygon& polygon);
  /// The cell last given to decode_few(), with its plane.
  [[nodiscard]] LeafError of_few(const TreeCell& cell, const Plane& plane, std::uint8_t noise) const;
  /// More points. @param beside  squared distances to the plane. @param missed  see missed().
  /// @param roughness  see roughness(); only where noise > 0.
  [[nodiscard]] LeafError of_many(const TreeCell& cell, const Plane& plane, const Polygon& polygon,
                                  double beside, double missed, std::uint8_t noise, double roughness,
                                  double lambda) const;
  /// Squared distances from the polygon to the nearest originals where there are none near, over all the
  /// points that the leaf would give. @param most  a larger sum may be cut short above it.
  [[nodiscard]] double missed(const TreeCell& cell, const Plane& plane, const Polygon& polygon,
                              std::uint32_t probes, double most = kNever);
  /// 1 where heights of points side by side have nothing in common, 0 where they are the same.
  [[nodiscard]] double roughness(const TreeCell& cell, const Plane& plane, double mean_squared) const;
  /// The line that cuts most off the polygon without cutting off points; false if none cuts much.
  [[nodiscard]] bool find_wedge(const TreeCell& cell, const Plane& plane, const Polygon& polygon,
                                Wedge& wedge) const;

 private:
  using Place = std::array<double, 3>;
  static Place place(const TreeCell& cell, const Plane& plane, const Vertex& x);
  /// Places spread evenly over the polygon, in no particular order.
  static void scatter(const TreeCell& cell, const Plane& plane, const Polygon& polygon, std::uint32_t count,
                      std::vector<Place>& out);
  static double squared(const Place& a, const Units& b);

  std::span<const Units> points_;
  MomentTable moments_;
  Coverage coverage_;
  static constexpr float kFarPlace = 1e12F;
  struct FewPlaces {
    std::array<std::array<float, kFew>, 3> at;  ///< by axis, from the cell's lowest corner
  };
  FewPlaces few_{};
  std::vector<Vertex> vertices_;  // scratch
  std::vector<Place> places_;     // scratch
};

/// Squared distances of a leaf's points to its plane, as its decoded points' thickness changes them in both
/// directions: n points fill a slab, each alone in its share of the volume.
void thicken(double n, double area, double beside, std::uint8_t noise, double roughness, double& forth,
             double& back);

/// Of the squared distances to a plane, what the nearest originals keep.
inline constexpr double kBackShare = 0.3;

/// Area of a polygon on its plane [units^2].
[[nodiscard]] double area_of(const CellShape& shape, const Plane& plane, const Polygon& polygon);

}  // namespace mapcodec::surface
