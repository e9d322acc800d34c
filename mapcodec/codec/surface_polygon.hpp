// SPDX-License-Identifier: GPL-3.0-or-later
// The piece of a plane inside a cell, and points spread over it (FORMAT.md 10.5).
#pragma once

#include <vector>

#include "mapcodec/codec/surface_outline.hpp"

namespace mapcodec::surface {

/// Corner in a cell's own coordinates: 32768 = half a side.
struct Vertex {
  std::int32_t u, v;
};
inline constexpr int kVertexBits = 15;
inline constexpr std::int32_t kHalf = 1 << kVertexBits;

/// Convex, at most twelve corners, counter-clockwise.
struct Polygon {
  std::array<Vertex, 12> at;
  int size = 0;
  bool rectangle = false;  ///< corners at (u0, v0), (u1, v0), (u1, v1), (u0, v1)
};

/// A line that cuts a leaf's polygon: what lies beyond it holds no point.
struct Wedge {
  std::uint8_t angle = 0;   ///< 0..15: sixteenths of a turn
  std::uint8_t offset = 0;  ///< 0..31
};

/// Keeps where c + (gu u + gv v) / 32768 <= 0.
void clip(Polygon& polygon, std::int64_t c, std::int64_t gu, std::int64_t gv);

/// The room of a cell, as it looks along `axis`.
[[nodiscard]] Polygon rectangle_of(const Room& room, const CellShape& shape, unsigned axis);

/// The plane inside its cell's room; no corner if it misses the cell.
[[nodiscard]] Polygon polygon_of(const Plane& plane, const CellShape& shape, const Room& room);
void cut(Polygon& polygon, const Wedge& wedge);

/// Twice the area in vertex units.
[[nodiscard]] std::int64_t twice_area(const Polygon& polygon);

/// Share (0..256) of the plane's polygon in the lower half of the cell along `split_axis`.
[[nodiscard]] int lower_share(const Plane& plane, const CellShape& shape, const Room& room,
                              unsigned split_axis);
/// The same, if the polygon is known.
[[nodiscard]] int lower_share(const Polygon& polygon, const Plane& plane, const CellShape& shape,
                              const Room& room, unsigned split_axis);

/// By how much the density of points changes from a cell's middle to its upper faces, in 1/256.
struct Tilt {
  std::int32_t u = 0, v = 0;
  [[nodiscard]] bool any() const { return u != 0 || v != 0; }
};

/// `count` points evenly over the polygon: it is cut across its longer side into pieces of areas as count/2
/// rounded down to the rest, again and again; each last piece gives its centroid. With a tilt the areas
/// differ as the density does. Appends to `out`.
void spread(const Polygon& polygon, const Plane& plane, const CellShape& shape, std::uint32_t count,
            const Tilt& tilt, std::vector<Vertex>& out);

/// Height of the plane over a vertex, kept inside the cell.
[[nodiscard]] inline std::int64_t height_at(const Plane& p, const CellShape& shape, const Vertex& x) {
  const std::int64_t half = half_side(shape[p.axis]);
  const std::int64_t z = p.h + ((std::int64_t{p.a} * x.u + std::int64_t{p.b} * x.v) >> kVertexBits);
  return z > half ? half : (z < -half ? -half : z);
}

/// How far [heights] a leaf's i-th point lies from its plane, where the leaf is `noise` thick: 0 not at all,
/// else evenly over +-2^(noise + 2) units, so that points side by side are far from each other.
[[nodiscard]] constexpr std::int64_t noise_offset(std::uint8_t noise, std::size_t i) {
  if (noise == 0) return 0;
  std::int64_t reversed = 0;
  for (int bit = 0; bit < 8; ++bit) reversed |= static_cast<std::int64_t>((i >> bit) & 1) << (7 - bit);
  return ((2 * reversed - 255) << (noise + 2 + kHeightBits)) >> 8;
}
inline constexpr std::uint8_t kMostNoise = 4;

}  // namespace mapcodec::surface
