// SPDX-License-Identifier: GPL-3.0-or-later
// A plane as a cell of the surface tree sees it: relative to the cell, in fixed point (FORMAT.md 10.2).
//
// Lengths are counted in tile units; the surface step is 32 of them, a plane's parameters are coded in steps
// of 16. Heights are in 1/256 of a unit, so that halving a cell stays exact for a long way down.
#pragma once

#include <array>
#include <cstdint>

namespace mapcodec::surface {

inline constexpr int kHeightBits = 8;                   ///< fractional bits of heights
inline constexpr int kStepUnits = 32;                   ///< surface step s in units
inline constexpr int kPlaneStepBits = 4 + kHeightBits;  ///< log2 of the plane step (16 units) in heights
inline constexpr int kLongestSide = 21;                 ///< log2 of the longest side of a root cell [units]
inline constexpr std::int32_t kMostHeight = 1 << 30;

/// log2 of a cell's sides [units].
using CellShape = std::array<std::uint8_t, 3>;

/// Half of a side in heights' fixed point.
[[nodiscard]] constexpr std::int64_t half_side(std::uint8_t log2_side) {
  return std::int64_t{1} << (log2_side + kHeightBits - 1);
}

/// z = h + a x + b y, where z is the height along `axis` from the cell's centre and x, y in [-1, 1] run from
/// face to face along the two axes that follow `axis` (cyclically).
struct Plane {
  std::int32_t h = 0, a = 0, b = 0;
  std::uint8_t axis = 2;
};

[[nodiscard]] constexpr std::int32_t clamp_height(std::int64_t v) {
  return static_cast<std::int32_t>(v > kMostHeight ? kMostHeight : (v < -kMostHeight ? -kMostHeight : v));
}

/// The same plane seen from the child on the left (lower) or right side of `split_axis`.
/// @param parent_side  log2 of the parent's side along split_axis, > 0.
[[nodiscard]] constexpr Plane in_child(const Plane& p, unsigned split_axis, bool right,
                                       std::uint8_t parent_side) {
  Plane c = p;
  if (split_axis == p.axis) {
    const std::int64_t shift = half_side(parent_side) / 2;
    c.h = clamp_height(p.h - (right ? shift : -shift));
    return c;
  }
  std::int32_t& rise = split_axis == (p.axis + 1u) % 3 ? c.a : c.b;
  rise >>= 1;
  c.h = clamp_height(std::int64_t{p.h} + (right ? rise : -rise));
  return c;
}

/// The plane of a cell at `at` seen from a cell of the same size or smaller at `to`.
[[nodiscard]] constexpr Plane seen_from(const Plane& p, const std::array<std::uint32_t, 3>& at,
                                        const CellShape& shape, const std::array<std::uint32_t, 3>& to,
                                        const CellShape& to_shape) {
  const unsigned u = (p.axis + 1u) % 3, v = (p.axis + 2u) % 3;
  // Between the centres, in half units.
  const auto between = [&](unsigned d) {
    return 2 * (std::int64_t{to[d]} - std::int64_t{at[d]}) + (std::int64_t{1} << to_shape[d]) -
           (std::int64_t{1} << shape[d]);
  };
  Plane r = p;
  r.h = clamp_height(p.h + ((p.a * between(u)) >> shape[u]) + ((p.b * between(v)) >> shape[v]) -
                     between(p.axis) * (1 << (kHeightBits - 1)));
  r.a = p.a >> (shape[u] - to_shape[u]);
  r.b = p.b >> (shape[v] - to_shape[v]);
  return r;
}

/// The plane with its height along `axis` instead; false if it is too steep for that.
[[nodiscard]] constexpr bool turn_to(Plane& p, std::uint8_t axis, const CellShape& shape) {
  if (p.axis == axis) return true;
  const bool first = (p.axis + 1u) % 3 == axis;
  const std::int64_t slope = first ? p.a : p.b, other = first ? p.b : p.a;
  const std::int64_t own = half_side(shape[p.axis]), target = half_side(shape[axis]);
  if (slope == 0 || (slope < 0 ? -slope : slope) * 4 < own) return false;
  const std::int64_t across = -target * other / slope, along = target * own / slope;
  const Plane turned{clamp_height(-target * std::int64_t{p.h} / slope), clamp_height(first ? across : along),
                     clamp_height(first ? along : across), axis};
  p = turned;
  return true;
}

}  // namespace mapcodec::surface
