// SPDX-License-Identifier: GPL-3.0-or-later
// Algorithm 1 of the paper: a cloud becomes planes of triangles and the points that are on none.
#pragma once

#include "mapcodec/base/result.hpp"
#include "mapcodec/codec/paper_mesh.hpp"
#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec::paper {

struct Extraction {
  std::vector<LatticePlane> planes;      ///< in the order found, largest first as RANSAC sees them
  std::vector<std::uint32_t> leftovers;  ///< ascending indices of the points on no plane
};

/// Planes by RANSAC, radius outlier removal, K-means on colour, alpha shape, contour reduction, constrained
/// Delaunay triangulation and the test m / A > rel_area, as in [Morell et al. 2014], with one addition
/// (PaperSettings::outside_density: triangles beyond the outline need a density worth the name) and three
/// choices where the paper is silent: points of a cluster that no kept triangle covers stay as points;
/// contours are rounded to the lattice before they are triangulated, so that the counts are those of the
/// stored triangles; a triangle's colour is the mean of its points.
/// @param xyz     [m] relative to the tile's corner, finite.
/// @param colors  one per point, or empty.
/// @param step_m  vertex step of the lattice.
/// Errors: InvalidArgument. Threads: pure.
[[nodiscard]] Result<Extraction> extract_planes(std::span<const Vec3> xyz,
                                                std::span<const std::array<std::uint16_t, 3>> colors,
                                                const PaperSettings& settings, double step_m);

}  // namespace mapcodec::paper
