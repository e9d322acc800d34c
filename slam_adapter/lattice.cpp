// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/lattice.hpp"

#include <cmath>

#include "mapcodec/geometry/quantizer.hpp"

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;

double largest_coordinate(const Box& b) {
  double m = 0;
  for (std::size_t d = 0; d < 3; ++d) m = std::max({m, std::abs(b.min[d]), std::abs(b.max[d])});
  return m;
}

/// What rounding a centre to the format can add to an error [m]: half a unit in the last place of the
/// farthest point.
double rounding_m(const CoordinateFormat& format, const Box& bounds, double max_error_m) {
  const double far = largest_coordinate(bounds) + max_error_m;
  if (format.kind == Kind::f32) {
    const auto f = static_cast<float>(far);
    return (double(std::nextafter(f, std::numeric_limits<float>::infinity())) - double(f)) / 2;
  }
  return 4 * (std::nextafter(far, std::numeric_limits<double>::infinity()) - far);
}

bool has_one_scale(const CoordinateFormat& f) {
  return f.scale[0] == f.scale[1] && f.scale[1] == f.scale[2];
}

/// Voxels of an odd number of units, centred on a unit: what is decoded lies on the source's own lattice.
Lattice on_source_lattice(double units_each_side, const CoordinateFormat& format, const Vec3& origin) {
  const double unit = format.scale[0];
  Lattice r{origin, unit * (2 * units_each_side + 1)};
  for (std::size_t d = 0; d < 3; ++d) {
    r.origin[d] = format.offset[d] + (std::floor((origin[d] - format.offset[d]) / unit) - 0.5) * unit;
  }
  return r;
}

}  // namespace

Lattice lattice_for_max_error(double max_error_m, const CoordinateFormat& format, const Box& bounds,
                              const Vec3& origin) {
  if (format.kind == Kind::fixed && has_one_scale(format)) {
    // A hair below the bound, so that an exact multiple does not exceed it by the last bit of a double.
    return on_source_lattice(std::floor(max_error_m * (1 - 1e-9) / format.scale[0]), format, origin);
  }
  const double rounding = rounding_m(format, bounds, max_error_m);
  // Far from the origin the format is coarser than the bound. Its numbers are then so sparse that each is
  // alone in a voxel of the bound's size, and rounding the centre gives it back: a centre is never farther
  // from its float than from the point.
  if (rounding > max_error_m / 2) return Lattice{origin, max_error_m};
  return Lattice{origin, 2 * (max_error_m - rounding)};
}

double lattice_rms(std::span<const Vec3> points, const Lattice& lattice, Kind kind) {
  const Quantizer q{lattice.origin, lattice.step_m, kind};
  double sum = 0;
  for (const Vec3& p : points) {
    for (std::size_t d = 0; d < 3; ++d) {
      const double e = p[d] - q.centre(q.lattice(p[d], d), d);
      sum += e * e;
    }
  }
  return points.empty() ? 0 : std::sqrt(sum / static_cast<double>(points.size()));
}

Lattice lattice_for_rms(double rms_m, const CoordinateFormat& format, std::span<const Vec3> sample,
                        const Vec3& origin) {
  // Errors spread evenly over a voxel give rms = step / 2; flat or gridded clouds can allow more or less.
  double low = rms_m / 2, high = rms_m * 4;
  for (int i = 0; i < 24; ++i) {
    const double middle = std::sqrt(low * high);
    (lattice_rms(sample, {origin, middle}, format.kind) <= rms_m ? low : high) = middle;
  }
  return Lattice{origin, low};
}

}  // namespace mapcodec
