// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_moments.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec::surface {
namespace {

constexpr double kHeightUnit = 1.0 / (1 << kHeightBits);
constexpr double kSteepest = 1.35;  // a little above 45 degrees: the best axis is never much steeper

// A plane's slope is only worth what the points' extent shows: extents below a third of the step count as
// none.
constexpr double kRidge = (kStepUnits / 3.0) * (kStepUnits / 3.0) / 4;

// Wraps like two's complement: the sums of a small cell far from the base are differences of large ones.
std::int64_t times(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) * static_cast<std::uint64_t>(b));
}
std::int64_t plus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}
std::int64_t minus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

constexpr unsigned kPair[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};

struct Regression {
  double a = 0, b = 0, mean = 0, orthogonal = 0;
};

Regression regress(const Moments& m, unsigned axis) {
  const unsigned u = (axis + 1) % 3, v = (axis + 2) % 3;
  const double n = m.n, mu = m.first[u] / n, mv = m.first[v] / n, mz = m.first[axis] / n;
  const double uu = m.product(u, u) / n - mu * mu + kRidge, vv = m.product(v, v) / n - mv * mv + kRidge;
  const double uv = m.product(u, v) / n - mu * mv, uz = m.product(u, axis) / n - mu * mz;
  const double vz = m.product(v, axis) / n - mv * mz, zz = m.product(axis, axis) / n - mz * mz;
  Regression r;
  const double det = uu * vv - uv * uv;
  r.a = std::clamp((uz * vv - vz * uv) / det, -kSteepest, kSteepest);
  r.b = std::clamp((vz * uu - uz * uv) / det, -kSteepest, kSteepest);
  r.mean = mz - r.a * mu - r.b * mv;
  const double left = zz - 2 * (r.a * uz + r.b * vz) + r.a * r.a * uu + r.b * r.b * vv + 2 * r.a * r.b * uv;
  r.orthogonal = left / (1 + r.a * r.a + r.b * r.b);
  return r;
}

std::int32_t on_lattice(double heights) {
  const double steps = std::nearbyint(std::clamp(heights, -1e9, 1e9) / (1 << kPlaneStepBits));
  return clamp_height(static_cast<std::int64_t>(steps) * (1 << kPlaneStepBits));
}

}  // namespace

MomentTable::MomentTable(std::span<const Units> points) : before_(points.size() + 1) {
  Sums sums{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    before_[i] = sums;
    // In half units, where a cell's middle is a whole number.
    const std::int64_t p[3] = {2 * std::int64_t{points[i][0]} + 1, 2 * std::int64_t{points[i][1]} + 1,
                               2 * std::int64_t{points[i][2]} + 1};
    for (std::size_t d = 0; d < 3; ++d) sums[d] = plus(sums[d], p[d]);
    for (std::size_t q = 0; q < 6; ++q)
      sums[3 + q] = plus(sums[3 + q], times(p[kPair[q][0]], p[kPair[q][1]]));
  }
  before_[points.size()] = sums;
}

Moments MomentTable::about(std::size_t begin, std::size_t end, const Units& twice_center) const {
  const Sums &lo = before_[begin], &hi = before_[end];
  const auto n = static_cast<std::int64_t>(end - begin);
  std::array<std::int64_t, 3> sum;
  Moments m;
  m.n = static_cast<double>(n);
  for (std::size_t d = 0; d < 3; ++d) {
    sum[d] = minus(hi[d], lo[d]);
    m.first[d] = static_cast<double>(minus(sum[d], times(n, twice_center[d]))) * 0.5;
  }
  for (std::size_t q = 0; q < 6; ++q) {
    const unsigned d = kPair[q][0], e = kPair[q][1];
    std::int64_t s = minus(hi[3 + q], lo[3 + q]);
    s = minus(s, plus(times(twice_center[d], sum[e]), times(twice_center[e], sum[d])));
    s = plus(s, times(n, times(twice_center[d], twice_center[e])));
    m.second[q] = static_cast<double>(s) * 0.25;
  }
  return m;
}

bool fit_plane(const Moments& m, const CellShape& shape, unsigned wanted_axis, Plane& plane) {
  if (m.n < 3) return false;
  unsigned best = 0;
  Regression fits[3];
  for (unsigned k = 0; k < 3; ++k) {
    fits[k] = regress(m, k);
    if (fits[k].orthogonal < fits[best].orthogonal) best = k;
  }
  if (wanted_axis < 3 &&
      fits[wanted_axis].orthogonal < 1.1 * fits[best].orthogonal + 0.002 * kStepUnits * kStepUnits) {
    best = wanted_axis;
  }
  const Regression& r = fits[best];
  plane.axis = static_cast<std::uint8_t>(best);
  plane.h = on_lattice(r.mean / kHeightUnit);
  plane.a = on_lattice(r.a * static_cast<double>(half_side(shape[(best + 1) % 3])));
  plane.b = on_lattice(r.b * static_cast<double>(half_side(shape[(best + 2) % 3])));
  return true;
}

Slopes slopes_of(const Plane& plane, const CellShape& shape) {
  return {plane.a / static_cast<double>(half_side(shape[(plane.axis + 1u) % 3])),
          plane.b / static_cast<double>(half_side(shape[(plane.axis + 2u) % 3])), plane.h * kHeightUnit};
}

double squared_distances(const Moments& m, const CellShape& shape, const Plane& plane) {
  const unsigned k = plane.axis, u = (k + 1) % 3, v = (k + 2) % 3;
  const Slopes s = slopes_of(plane, shape);
  const double sum = m.product(k, k) + m.n * s.h * s.h + s.a * s.a * m.product(u, u) +
                     s.b * s.b * m.product(v, v) - 2 * s.h * m.first[k] - 2 * s.a * m.product(u, k) -
                     2 * s.b * m.product(v, k) + 2 * s.h * (s.a * m.first[u] + s.b * m.first[v]) +
                     2 * s.a * s.b * m.product(u, v);
  return std::max(0.0, sum) / s.stretch_squared();
}

}  // namespace mapcodec::surface
