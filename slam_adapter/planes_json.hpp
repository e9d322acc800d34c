// SPDX-License-Identifier: GPL-3.0-or-later
// Planes and cylinders as text that any program reads.
#pragma once

#include <string>
#include <vector>

#include "slam_adapter/cylinders.hpp"

namespace mapcodec {

/// What a map's surfaces were found to be.
struct MapPrimitives {
  std::uint64_t map_points = 0;  ///< of the tiles that were read
  std::uint64_t patches = 0;     ///< flat pieces in their cells
  double tolerance_m = 0;        ///< as the planes were merged with
  std::vector<MapPlane> planes;
  bool with_cylinders = false;
  std::vector<MapCylinder> cylinders;
};

/// The text of one JSON object [metres, map frame; colours 0..255]:
/// @code
/// {"format": "mapcodec planes", "version": 1,
///  "map_points": N, "plane_points": n, "cylinder_points": m,   // the rest lies on no primitive large enough
///  "patches": k, "tolerance_m": t,
///  "planes": [{"normal": [x, y, z], "offset": d,               // normal . p = offset; normal is a unit
///  vector
///              "points": n, "rms": r,                          // of the decoded points about the plane
///              "area": a,                                      // of the surface, square metres
///              "center": [x, y, z],                            // mean of the points
///              "color": [r, g, b],                             // mean; absent where the map keeps no colour
///              "polygon": [[x, y, z], ...],                    // outline of its largest piece,
///              counter-clockwise
///                                                              // seen from where the normal points
///              "holes": [[[x, y, z], ...], ...],               // in that piece, clockwise
///              "pieces": [{"polygon": .., "holes": ..}, ...]   // further pieces, larger ones first
///             }, ...],                                         // most points first
///  "cylinders": [{"axis": [x, y, z], "center": [x, y, z],      // unit axis; middle of the axis
///                 "radius": r, "length": l, "arc": a,          // arc: of the circle that has surface [rad]
///                 "points": n, "rms": r, "planes_rms": q, "planes": k, // k planes of that RMS it stands for
///                 "color": [r, g, b]}, ...]}                   // absent where they were not asked for
/// @endcode
/// Points of a cylinder are on no plane. Coordinates have digits to a hundredth of the tolerance.
[[nodiscard]] std::string primitives_json(const MapPrimitives& primitives);

}  // namespace mapcodec
