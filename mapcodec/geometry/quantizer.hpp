// SPDX-License-Identifier: GPL-3.0-or-later
// Metres to cells of the map's one global lattice, and back to their centres.
#pragma once

#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// Cells [origin + v step, origin + (v + 1) step] per axis. The lattice is the same for all tiles of a map,
/// so that decoding and encoding again changes nothing. Every point lies within step / 2 of its cell's centre
/// on each axis, in double, before a float32 centre is rounded. Threads: pure.
struct Quantizer {
  Vec3 origin{0, 0, 0};                                       ///< [m, map frame]
  double step_m = 0;                                          ///< side of a cell, > 0
  CoordinateFormat::Kind kind = CoordinateFormat::Kind::f32;  ///< f32: centres are float32 numbers

  /// Whether `p` is finite and its cell's numbers stay below 2^52 (beyond it a cell is finer than a double).
  [[nodiscard]] bool accepts(const Vec3& p) const {
    constexpr double kMost = 4503599627370496.0;
    for (std::size_t d = 0; d < 3; ++d) {
      if (!(std::abs((p[d] - origin[d]) / step_m) < kMost)) return false;
    }
    return true;
  }

  /// Cell of coordinate `x` [m] on `axis`. Only for coordinates that accepts() takes.
  [[nodiscard]] std::int64_t lattice(double x, std::size_t axis) const {
    const double cells = (x - origin[axis]) / step_m;
    auto v = static_cast<std::int64_t>(cells);
    v -= static_cast<double>(v) > cells;
    const double off = x - exact_centre(v, axis);
    return std::abs(off) <= 0.5 * step_m ? v : nearer(x, axis, v, off);
  }

  /// Centre [m] of cell `v` on `axis`, as a file of this kind can hold it.
  [[nodiscard]] double centre(std::int64_t v, std::size_t axis) const {
    const double c = exact_centre(v, axis);
    return kind == CoordinateFormat::Kind::f32 ? rounded_to_float(c) : c;
  }

 private:
  [[nodiscard]] double exact_centre(std::int64_t v, std::size_t axis) const {
    return origin[axis] + (static_cast<double>(v) + 0.5) * step_m;
  }
  // GCC 12.2 at -O3 vectorises pairs of double -> float -> double into nothing; volatile keeps the rounding.
  [[nodiscard]] static double rounded_to_float(double c) {
    const volatile float f = static_cast<float>(c);
    return f;
  }
  // Rounding put x just outside its cell: the next one may hold it.
  [[nodiscard]] std::int64_t nearer(double x, std::size_t axis, std::int64_t v, double off) const {
    const std::int64_t other = off > 0 ? v + 1 : v - 1;
    return std::abs(x - exact_centre(other, axis)) < std::abs(off) ? other : v;
  }
};

}  // namespace mapcodec
