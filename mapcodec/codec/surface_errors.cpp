// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_errors.hpp"

#include <cmath>

namespace mapcodec::surface {
namespace {

constexpr double kCoveredSteps2 = 0.4;  // a place so near to a point [steps^2] is covered
// Mean squared distance, in shares of the area that one point has, of any place on a plane to the nearest of
// points on a square lattice, as decoded ones are, and of points at random, as originals are.
constexpr double kToLattice = 1.0 / 6, kToRandom = 0.3183;
constexpr double kFilled = 0.32;  // mean squared distance of points in a volume, each alone in a share of 1

double cosine(unsigned sixteenth) {
  static constexpr double kTable[16] = {
      1,  0.92387953,  0.70710678,  0.38268343,  0, -0.38268343, -0.70710678, -0.92387953,
      -1, -0.92387953, -0.70710678, -0.38268343, 0, 0.38268343,  0.70710678,  0.92387953};
  return kTable[sixteenth % 16];
}

/// How far points reach in each of sixteen directions, in halves of the cell's sides.
std::array<double, 16> reach_of(std::span<const Units> points, const TreeCell& cell, unsigned u, unsigned v) {
  const Units c = cell.twice_center();
  const double scale_u = 2.0 / double(1u << cell.shape[u]), scale_v = 2.0 / double(1u << cell.shape[v]);
  // Opposite directions are one product's most and least.
  std::array<double, 8> most, least;
  most.fill(-10);
  least.fill(10);
  const std::size_t stride = 1 + cell.count() / 256;
  for (std::size_t i = cell.begin; i < cell.end; i += stride) {
    const double x = (points[i][u] + 0.5 - 0.5 * c[u]) * scale_u,
                 y = (points[i][v] + 0.5 - 0.5 * c[v]) * scale_v;
    for (unsigned a = 0; a < 8; ++a) {
      const double along = x * cosine(a) + y * cosine(a + 12);
      most[a] = along > most[a] ? along : most[a];
      least[a] = along < least[a] ? along : least[a];
    }
  }
  std::array<double, 16> reach;
  for (unsigned a = 0; a < 8; ++a) {
    reach[a] = most[a];
    reach[a + 8] = -least[a];
  }
  return reach;
}

/// Squared distance to the nearest of kCount places; each of them remembers the least it took part in.
template <std::size_t kCount, std::size_t kRoom>
float nearest_of(const std::array<std::array<float, kRoom>, 3>& places, float x, float y, float z,
                 std::array<float, kRoom>& near) {
  std::array<float, kCount> squared;
  for (std::size_t i = 0; i < kCount; ++i) {
    const float dx = places[0][i] - x, dy = places[1][i] - y, dz = places[2][i] - z;
    squared[i] = dx * dx + dy * dy + dz * dz;
    near[i] = squared[i] < near[i] ? squared[i] : near[i];
  }
  for (std::size_t half = kCount / 2; half >= 4; half /= 2) {
    for (std::size_t i = 0; i < half; ++i)
      squared[i] = squared[i + half] < squared[i] ? squared[i + half] : squared[i];
  }
  return std::min(std::min(squared[0], squared[1]), std::min(squared[2], squared[3]));
}

using Place = std::array<double, 3>;

Place operator-(const Place& a, const Place& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double area_of(const Place& a, const Place& b) {
  const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  return std::sqrt(x * x + y * y + z * z);
}

/// Places of a lattice of `count` in the unit square, in the order of their first coordinate.
constexpr double kGolden = 0.6180339887498949;

void scatter_rectangle(const Place& corner, const Place& u, const Place& v, std::uint32_t count,
                       std::vector<Place>& out) {
  double y = 0.5;
  for (std::uint32_t i = 0; i < count; ++i) {
    const double x = (i + 0.5) / count;
    out.push_back(
        {corner[0] + x * u[0] + y * v[0], corner[1] + x * u[1] + y * v[1], corner[2] + x * u[2] + y * v[2]});
    y += kGolden;
    y -= y >= 1 ? 1 : 0;
  }
}

/// The polygon as a fan of triangles, each a folded square.
void scatter_fan(std::span<const Place> corners, std::uint32_t count, std::vector<Place>& out) {
  std::array<double, 12> upto{};
  double all = 0;
  for (std::size_t t = 0; t + 2 < corners.size(); ++t) {
    all += area_of(corners[t + 1] - corners[0], corners[t + 2] - corners[0]);
    upto[t] = all;
  }
  double y = 0.5, from = 0;
  std::size_t t = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const double at = (i + 0.5) / count * all;
    while (at > upto[t] && t + 3 < corners.size()) from = upto[t++];
    double x = (at - from) / std::max(upto[t] - from, 1e-12), z = y;
    if (x + z > 1) {
      x = 1 - x;
      z = 1 - z;
    }
    const Place u = corners[t + 1] - corners[0], v = corners[t + 2] - corners[0];
    out.push_back({corners[0][0] + x * u[0] + z * v[0], corners[0][1] + x * u[1] + z * v[1],
                   corners[0][2] + x * u[2] + z * v[2]});
    y += kGolden;
    y -= y >= 1 ? 1 : 0;
  }
}

}  // namespace

void LeafErrors::scatter(const TreeCell& cell, const Plane& plane, const Polygon& polygon,
                         std::uint32_t count, std::vector<Place>& out) {
  std::array<Place, 12> corners;
  const auto size = static_cast<std::size_t>(polygon.size);
  for (std::size_t i = 0; i < size; ++i) corners[i] = place(cell, plane, polygon.at[i]);
  if (polygon.rectangle) {
    scatter_rectangle(corners[0], corners[1] - corners[0], corners[3] - corners[0], count, out);
  } else {
    scatter_fan({corners.data(), size}, count, out);
  }
}

LeafErrors::Place LeafErrors::place(const TreeCell& cell, const Plane& plane, const Vertex& x) {
  Place r;
  const Units c = cell.twice_center();
  const unsigned k = plane.axis, u = (k + 1) % 3, v = (k + 2) % 3;
  r[u] = 0.5 * c[u] + x.u * (double(1u << cell.shape[u]) / (2.0 * kHalf));
  r[v] = 0.5 * c[v] + x.v * (double(1u << cell.shape[v]) / (2.0 * kHalf));
  r[k] = 0.5 * c[k] + double(height_at(plane, cell.shape, x)) / (1 << kHeightBits);
  return r;
}

double LeafErrors::squared(const Place& a, const Units& b) {
  double s = 0;
  for (unsigned d = 0; d < 3; ++d) s += (a[d] - b[d] - 0.5) * (a[d] - b[d] - 0.5);
  return s;
}

LeafError LeafErrors::at_center(const TreeCell& cell, const Moments& m) const {
  LeafError e;
  e.forth = e.back = m.second[0] + m.second[1] + m.second[2];
  if (cell.count() > 1) {
    const Units c = cell.twice_center();
    const Place center{0.5 * c[0], 0.5 * c[1], 0.5 * c[2]};
    double least = kNever;
    for (std::size_t i = cell.begin; i < cell.end; i += 1 + cell.count() / 8)
      least = std::min(least, squared(center, points_[i]));
    e.back = least * cell.count();
  }
  e.beside_forth = e.forth;
  e.beside_back = e.back;
  return e;
}

double LeafErrors::of_single(const TreeCell& cell, const Plane* plane, const Polygon& polygon) {
  const Units c = cell.twice_center();
  Place at{0.5 * c[0], 0.5 * c[1], 0.5 * c[2]};
  if (plane != nullptr) {
    if (polygon.rectangle && polygon.at[2].u == kHalf && polygon.at[2].v == kHalf) {
      at[plane->axis] += double(plane->h) / (1 << kHeightBits);
    } else if (polygon.size >= 3) {
      vertices_.clear();
      spread(polygon, *plane, cell.shape, 1, {}, vertices_);
      at = place(cell, *plane, vertices_[0]);
    }
  }
  return squared(at, points_[cell.begin]);
}

void LeafErrors::decode_few(const TreeCell& cell, const Plane& plane, const Polygon& polygon) {
  vertices_.clear();
  spread(polygon, plane, cell.shape, cell.count(), {}, vertices_);
  // Far places fill the rest, so that loops over all of them have a fixed length.
  for (auto& row : few_.at) row.fill(kFarPlace);
  for (std::uint32_t i = 0; i < cell.count(); ++i) {
    const Place p = place(cell, plane, vertices_[i]);
    for (std::size_t d = 0; d < 3; ++d) few_.at[d][i] = static_cast<float>(p[d] - 0.5 - cell.at[d]);
  }
}

LeafError LeafErrors::of_few(const TreeCell& cell, const Plane& plane, std::uint8_t noise) const {
  FewPlaces few = few_;
  if (noise != 0) {
    for (std::uint32_t i = 0; i < cell.count(); ++i)
      few.at[plane.axis][i] += static_cast<float>(noise_offset(noise, i)) / (1 << kHeightBits);
  }
  std::array<float, kFew> near;
  near.fill(kFarPlace * kFarPlace);
  double forth = 0;
  for (std::size_t j = cell.begin; j < cell.end; ++j) {
    const float x = static_cast<float>(points_[j][0] - static_cast<std::int32_t>(cell.at[0])),
                y = static_cast<float>(points_[j][1] - static_cast<std::int32_t>(cell.at[1])),
                z = static_cast<float>(points_[j][2] - static_cast<std::int32_t>(cell.at[2]));
    forth += static_cast<double>(cell.count() > kFew / 2   ? nearest_of<kFew>(few.at, x, y, z, near)
                                 : cell.count() > kFew / 4 ? nearest_of<kFew / 2>(few.at, x, y, z, near)
                                                           : nearest_of<kFew / 4>(few.at, x, y, z, near));
  }
  double back = 0;
  for (std::uint32_t i = 0; i < cell.count(); ++i) back += static_cast<double>(near[i]);
  return {forth, back, forth, back};
}

LeafError LeafErrors::of_many(const TreeCell& cell, const Plane& plane, const Polygon& polygon, double beside,
                              double missed, std::uint8_t noise, double roughness, double lambda) const {
  const double area = area_of(cell.shape, plane, polygon);
  double forth = beside, back = kBackShare * beside;
  if (noise != 0) thicken(cell.count(), area, beside, noise, roughness, forth, back);
  // Dividing lowers what lies beside the surface and what is missed; the positions on it only where they are
  // worth bits.
  const double in_plane = kToLattice * area, back_in_plane = kToRandom * area;
  const double on_it = std::max(0.0, in_plane - 0.5 * lambda * cell.count());
  return {forth + in_plane, back_in_plane + missed + back, forth + on_it,
          missed + back + kToRandom / kToLattice * on_it};
}

double LeafErrors::missed(const TreeCell& cell, const Plane& plane, const Polygon& polygon,
                          std::uint32_t probes, double most) {
  const std::uint32_t n = cell.count();
  const double covered = area_of(cell.shape, plane, polygon) / n + kStep2 * kCoveredSteps2;
  places_.clear();
  scatter(cell, plane, polygon, probes, places_);
  const double share = n / double(places_.size());
  return coverage_.sum_of_squared(places_, covered, most / share) * share;
}

double LeafErrors::roughness(const TreeCell& cell, const Plane& plane, double mean_squared) const {
  const Slopes slopes = slopes_of(plane, cell.shape);
  const unsigned k = plane.axis, u = (k + 1) % 3, v = (k + 2) % 3;
  double sum = 0, count = 0;
  const std::size_t stride = 1 + cell.count() / 64;
  for (std::size_t i = cell.begin; i + 1 < cell.end; i += stride, ++count) {
    const Units &p = points_[i], &q = points_[i + 1];
    const double h = (p[k] - q[k]) - slopes.a * (p[u] - q[u]) - slopes.b * (p[v] - q[v]);
    sum += h * h;
  }
  return std::min(1.0, sum / std::max(1.0, count) / slopes.stretch_squared() / (2 * mean_squared));
}

bool LeafErrors::find_wedge(const TreeCell& cell, const Plane& plane, const Polygon& polygon,
                            Wedge& wedge) const {
  const std::array<double, 16> reach = reach_of(points_, cell, (plane.axis + 1u) % 3, (plane.axis + 2u) % 3);
  const std::int64_t whole = twice_area(polygon);
  std::int64_t least = whole - whole / 16;
  bool found = false;
  for (unsigned a = 0; a < 16; ++a) {
    const double most = std::abs(cosine(a)) + std::abs(cosine(a + 12));
    const int offset = static_cast<int>(std::ceil(reach[a] / most * 16 - 0.25)) + 15;
    if (offset >= 31 || offset < 0) continue;
    const Wedge w{static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(offset)};
    Polygon p = polygon;
    cut(p, w);
    if (p.size < 3 || twice_area(p) >= least) continue;
    least = twice_area(p);
    wedge = w;
    found = true;
  }
  return found;
}

// The originals fill the slab as well only where the heights of neighbours have nothing in common; where they
// have, the slab comes near them, but its points are far from any.
void thicken(double n, double area, double beside, std::uint8_t noise, double roughness, double& forth,
             double& back) {
  const double thick = 2.0 * (4 << noise), own = std::sqrt(12 * beside / n);
  const double filled = kFilled * std::pow(area * std::max(std::min(thick, own), 1.0) / n, 2.0 / 3.0);
  const double slab = n * (std::max(0.0, filled - area / n / 6) + (thick - own) * (thick - own) / 24);
  forth = slab + (1 - std::min(1.0, 3 * roughness)) * beside;
  back = slab + (1 - roughness) * (beside + n * thick * thick / 12);
}

double area_of(const CellShape& shape, const Plane& plane, const Polygon& polygon) {
  const double scale_u = double(1u << shape[(plane.axis + 1u) % 3]) / (2.0 * kHalf);
  const double scale_v = double(1u << shape[(plane.axis + 2u) % 3]) / (2.0 * kHalf);
  return 0.5 * double(twice_area(polygon)) * scale_u * scale_v *
         std::sqrt(slopes_of(plane, shape).stretch_squared());
}

}  // namespace mapcodec::surface
