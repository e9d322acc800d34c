// SPDX-License-Identifier: GPL-3.0-or-later
// Alpha shape and constrained Delaunay triangulation in a plane, through CGAL.
#pragma once

#include "mapcodec/base/result.hpp"
#include "mapcodec/geometry/contour_reduction.hpp"

namespace mapcodec {

/// A contour as indices into the points given; the area is on its left: outlines run counter-clockwise, holes
/// clockwise.
using Contour = std::vector<std::uint32_t>;

/// Outlines and holes of the alpha shape [Edelsbrunner, Kirkpatrick, Seidel 1983] of `points`: the edge of
/// the union of the Delaunay triangles whose circumradius is at most alpha. An alpha below the points'
/// spacing makes it fall apart abruptly, so the radius used is at least twice the median circumradius.
/// @return no contour where the points span no area.
/// Errors: InvalidArgument (what CGAL throws). Threads: pure.
[[nodiscard]] Result<std::vector<Contour>> find_alpha_contours(std::span<const Point2> points,
                                                               double alpha_m);

struct PlanarTriangles {
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< indices of vertices, counter-clockwise
  std::vector<bool> inside;  ///< per triangle: an odd number of sides separates it from the outside
  std::vector<std::uint32_t> triangle_of;  ///< per queried point; kOutside beyond the convex hull
  static constexpr std::uint32_t kOutside = ~std::uint32_t{0};
};

/// Constrained Delaunay triangulation of the convex hull of `vertices` with the contours' sides as
/// constraints. A side that crosses one inserted before is left out: reduction and rounding can make sides
/// cross, and the triangle test that follows does not need them.
/// @param vertices  all different.
/// @param queries   points to locate.
/// Errors: InvalidArgument (what CGAL throws). Threads: pure.
[[nodiscard]] Result<PlanarTriangles> triangulate_contours(std::span<const Point2> vertices,
                                                           std::span<const Contour> contours,
                                                           std::span<const Point2> queries);

}  // namespace mapcodec
