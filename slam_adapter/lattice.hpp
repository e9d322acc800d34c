// SPDX-License-Identifier: GPL-3.0-or-later
// From a promise to the voxel lattice that keeps it.
#pragma once

#include <span>

#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

struct Lattice {
  Vec3 origin{0, 0, 0};  ///< [m, map frame]
  double step_m = 0;
};

/// The largest voxels whose centres, as the format will hold them, lie within `max_error_m` of every point of
/// the voxel along each axis. `origin` is moved by less than a voxel where the format has a lattice of its
/// own.
[[nodiscard]] Lattice lattice_for_max_error(double max_error_m, const CoordinateFormat& format,
                                            const Box& bounds, const Vec3& origin);

/// The largest voxels with which the root mean square distance of `sample` to the centres stays <= rms_m.
[[nodiscard]] Lattice lattice_for_rms(double rms_m, const CoordinateFormat& format,
                                      std::span<const Vec3> sample, const Vec3& origin);

/// Root mean square distance [m] of the points to their voxels' centres: the symmetric RMS of coding them so.
[[nodiscard]] double lattice_rms(std::span<const Vec3> points, const Lattice& lattice,
                                 CoordinateFormat::Kind kind);

}  // namespace mapcodec
