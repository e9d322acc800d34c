// SPDX-License-Identifier: GPL-3.0-or-later
// Planes of triangles on an integer lattice, and the contexts their symbols are coded in. Shared by the
// encoder and the decoder of the `paper` codec (FORMAT.md 7.2).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mapcodec/entropy/bit_model.hpp"
#include "mapcodec/entropy/integer_model.hpp"

namespace mapcodec::paper {

/// The plane is written as a height along its dominant axis k over the two other ones, u = (k + 1) % 3 and
/// v = (k + 2) % 3: no angle, no square root, and slopes of at most 1.
struct LatticeVertex {
  std::int64_t u = 0;  ///< in vertex steps from the tile's corner
  std::int64_t v = 0;
  bool operator==(const LatticeVertex&) const = default;
};

struct LatticeTriangle {
  std::array<std::uint32_t, 3> vertices{};  ///< counter-clockwise in (u, v), area > 0
  std::array<std::uint16_t, 3> rgb{};       ///< 0 without colour
  std::uint32_t points = 0;
};

struct LatticePlane {
  std::uint32_t axis = 2;    ///< k
  LatticeVertex low;         ///< corner of the vertices' bounding box
  LatticeVertex span{1, 1};  ///< its size, at least 1
  std::array<std::int64_t, 3>
      heights{};  ///< at low, and the rise from there to the far u and the far v, in height steps
  std::uint64_t points = 0;
  std::vector<LatticeVertex> vertices;
  std::vector<LatticeTriangle> triangles;
};

inline constexpr std::int64_t kMaxLattice = std::int64_t{1} << 24;  ///< coordinates lie within +-this
inline constexpr std::int64_t kMaxHeight = std::int64_t{1} << 40;
inline constexpr std::uint32_t kHeightsPerStep = 2;  ///< height steps in a vertex step
inline constexpr std::int64_t kDensityPerOctave =
    4;  ///< classes of points per area, relative to the plane's mean
inline constexpr std::int64_t kMaxDensity = 6 * kDensityPerOctave;

/// Most triangles that a stream of this many bytes may hold: a cap on what hostile bytes can make a decoder
/// allocate. An encoder whose triangles cost less (less than half a bit each) appends zero bytes.
[[nodiscard]] inline std::uint64_t max_triangles(std::uint64_t stream_bytes) {
  return 16 * (stream_bytes + 1);
}

/// Twice the signed area of a, b, c. Exact: differences are below 2^26.
[[nodiscard]] inline std::int64_t doubled_area(const LatticeVertex& a, const LatticeVertex& b,
                                               const LatticeVertex& c) {
  return (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
}

/// Weight of a triangle when a plane's points are shared out: its area times 2^(density / kDensityPerOctave).
/// @param area  doubled, below 2^40.
[[nodiscard]] inline std::uint64_t density_weight(std::uint64_t area, std::int64_t density) {
  constexpr std::array<std::uint64_t, 4> kMantissa{256, 304, 362, 431};  // 256 * 2^(i / 4)
  const auto d = static_cast<std::uint64_t>(density + kMaxDensity);
  return area * (kMantissa[d % 4] << (d / 4));
}

/// Every adaptive context of the coded planes; one set for all planes of a tile.
struct Models {
  IntegerModel components, points;
  std::array<IntegerModel, 2> low, span;
  std::array<IntegerModel, 3> height;
  std::array<IntegerModel, 2> seed;                           ///< first vertex of a component; the two others
  std::array<std::array<IntegerModel, 2>, 8> apex;            ///< [length of the gate][u, v]
  std::array<std::array<BitModel, 2>, 5> neighbor;            ///< [candidates][what the gate before had]
  std::array<BitModel, 5> is_candidate, is_previous, is_new;  ///< [candidates]
  std::array<IntegerModel, 3> color;
  IntegerModel density;
};

/// Context of a new vertex: half octaves do not pay, octaves of the gate's length do.
[[nodiscard]] inline std::size_t length_class(const LatticeVertex& a, const LatticeVertex& b) {
  const std::int64_t du = a.u < b.u ? b.u - a.u : a.u - b.u;
  const std::int64_t dv = a.v < b.v ? b.v - a.v : a.v - b.v;
  const int width = std::bit_width(static_cast<std::uint64_t>(du > dv ? du : dv));
  return static_cast<std::size_t>(width > 8 ? 7 : (width > 0 ? width - 1 : 0));
}

/// Where the apex of a triangle beyond the gate from -> to is expected, `opposite` being the vertex on the
/// near side.
[[nodiscard]] inline LatticeVertex predict_apex(const LatticeVertex& from, const LatticeVertex& to,
                                                const LatticeVertex& opposite) {
  return {from.u + to.u - opposite.u, from.v + to.v - opposite.v};
}

}  // namespace mapcodec::paper
