// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/plane_moments.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

using Matrix = std::array<std::array<double, 3>, 3>;

void add_outer(std::array<double, 6>& s, const Vec3& v, double w) {
  s[0] += w * v[0] * v[0];
  s[1] += w * v[0] * v[1];
  s[2] += w * v[0] * v[2];
  s[3] += w * v[1] * v[1];
  s[4] += w * v[1] * v[2];
  s[5] += w * v[2] * v[2];
}

/// One Jacobi rotation that makes a[p][q] zero; the columns of v follow.
void rotate(Matrix& a, Matrix& v, std::size_t p, std::size_t q) {
  if (a[p][q] == 0) return;
  const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
  const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
  const double c = 1 / std::sqrt(t * t + 1), s = t * c;
  for (std::size_t k = 0; k < 3; ++k) {
    const double x = a[k][p], y = a[k][q];
    a[k][p] = c * x - s * y;
    a[k][q] = s * x + c * y;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const double x = a[p][k], y = a[q][k];
    a[p][k] = c * x - s * y;
    a[q][k] = s * x + c * y;
    const double vx = v[k][p], vy = v[k][q];
    v[k][p] = c * vx - s * vy;
    v[k][q] = s * vx + c * vy;
  }
}

}  // namespace

std::array<Vec3, 2> plane_axes(const Vec3& n) {
  const std::size_t least = std::abs(n[0]) <= std::abs(n[1]) ? (std::abs(n[0]) <= std::abs(n[2]) ? 0u : 2u)
                                                             : (std::abs(n[1]) <= std::abs(n[2]) ? 1u : 2u);
  Vec3 e{0, 0, 0};
  e[least] = 1;
  Vec3 u = cross(n, e);
  const double l = std::sqrt(dot(u, u));
  for (double& x : u) x /= l;
  return {u, cross(n, u)};
}

PlaneMoments::PlaneMoments(const SurfacePatch& patch)
    : weight(static_cast<double>(patch.points)), mean(patch.center) {
  noise = weight * patch.noise_m * patch.noise_m;
  const Vec3& first = patch.polygon[0];
  for (std::size_t i = 1; i + 1 < patch.polygon.size(); ++i) {
    const std::array<Vec3, 3> t{first, patch.polygon[i], patch.polygon[i + 1]};
    const Vec3 n = cross(minus(t[1], t[0]), minus(t[2], t[0]));
    const double w = weight * std::sqrt(dot(n, n)) / 2 / patch.area_m2;
    // Of a triangle: a twelfth of its corners' sum of squares, and three quarters of its middle's.
    Vec3 middle{0, 0, 0};
    for (const Vec3& corner : t) {
      const Vec3 d = minus(corner, mean);
      add_outer(scatter, d, w / 12);
      for (std::size_t k = 0; k < 3; ++k) middle[k] += d[k] / 3;
    }
    add_outer(scatter, middle, w * 0.75);
  }
}

void PlaneMoments::add(const PlaneMoments& other) {
  if (other.weight <= 0) return;
  const double sum = weight + other.weight;
  const Vec3 d = minus(other.mean, mean);
  for (std::size_t i = 0; i < 6; ++i) scatter[i] += other.scatter[i];
  add_outer(scatter, d, weight * other.weight / sum);
  for (std::size_t k = 0; k < 3; ++k) mean[k] += d[k] * other.weight / sum;
  noise += other.noise;
  weight = sum;
}

double PlaneMoments::spread_along(const Vec3& n) const {
  const double s = scatter[0] * n[0] * n[0] + scatter[3] * n[1] * n[1] + scatter[5] * n[2] * n[2] +
                   2 * (scatter[1] * n[0] * n[1] + scatter[2] * n[0] * n[2] + scatter[4] * n[1] * n[2]);
  return std::max(0.0, s / weight);
}

FittedPlane fit_plane(const PlaneMoments& m) {
  const auto& s = m.scatter;
  Matrix a{{{s[0], s[1], s[2]}, {s[1], s[3], s[4]}, {s[2], s[4], s[5]}}};
  Matrix v{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int sweep = 0; sweep < 12; ++sweep) {
    rotate(a, v, 0, 1);
    rotate(a, v, 0, 2);
    rotate(a, v, 1, 2);
  }
  std::array<std::size_t, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t x, std::size_t y) { return a[x][x] < a[y][y]; });
  FittedPlane f;
  f.normal = {v[0][order[0]], v[1][order[0]], v[2][order[0]]};
  const double l = std::sqrt(dot(f.normal, f.normal));
  for (double& x : f.normal) x /= l;
  f.squared = std::max(0.0, a[order[0]][order[0]] / m.weight);
  f.least_extent = std::sqrt(std::max(0.0, a[order[1]][order[1]] / m.weight));
  f.extent_m = std::sqrt(std::max(0.0, a[order[2]][order[2]] / m.weight));
  return f;
}

}  // namespace mapcodec
