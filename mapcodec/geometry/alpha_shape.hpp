// SPDX-License-Identifier: GPL-3.0-or-later
// The concave hull of a dense set of points in a plane.
#pragma once

#include "mapcodec/geometry/planar_mesh.hpp"

namespace mapcodec {

/// find_alpha_contours for dense input: of the points whose square of side alpha / 4 and its eight neighbours
/// all hold points, one per square takes part. They lie well inside, so the contours stay the same and the
/// triangulation becomes several times smaller.
/// @param points  finite, less than 2^31 squares from (0, 0).
/// Errors: InvalidArgument. Threads: pure.
[[nodiscard]] Result<std::vector<Contour>> find_concave_hull(std::span<const Point2> points, double alpha_m);

/// The indices that take part, ascending.
[[nodiscard]] std::vector<std::uint32_t> thin_inner_points(std::span<const Point2> points, double side_m);

}  // namespace mapcodec
