// SPDX-License-Identifier: GPL-3.0-or-later
// Where in its root cell a tile's surface lies, and where it goes on in another tile (FORMAT.md 10.1).
#pragma once

#include "mapcodec/codec/surface_plane.hpp"

namespace mapcodec::surface {

inline constexpr std::int32_t kOverlap = 12;  ///< how far the surfaces of two tiles overlap [units]

/// Beyond it cells hold no surface.
struct Outline {
  bool fitted = false;                              ///< false in older tiles: they say nothing
  std::array<std::uint32_t, 3> end{~0u, ~0u, ~0u};  ///< [units from the base]
  std::uint8_t borders = 0;  ///< bit 2 axis, + 1 for the upper side: the surface goes on there

  [[nodiscard]] constexpr bool goes_on(unsigned axis, bool upper) const {
    return (borders >> (2 * axis + (upper ? 1 : 0)) & 1) != 0;
  }
};

/// The part of a cell that can hold surface [units from its corner].
struct Room {
  std::array<std::int32_t, 3> begin{0, 0, 0}, end;

  [[nodiscard]] static constexpr Room whole(const CellShape& s) {
    return {{0, 0, 0}, {1 << s[0], 1 << s[1], 1 << s[2]}};
  }
  [[nodiscard]] static constexpr Room in(const Outline& o, const std::array<std::uint32_t, 3>& at,
                                         const CellShape& s) {
    Room r = whole(s);
    for (unsigned d = 0; d < 3 && o.fitted; ++d) {
      const std::int64_t left = std::int64_t{o.end[d]} - at[d];
      if (left < r.end[d]) r.end[d] = left > 0 ? static_cast<std::int32_t>(left) : 1;
    }
    return r;
  }
  /// Makes it reach beyond the tile's borders across `axis`.
  constexpr void widen(const Outline& o, const std::array<std::uint32_t, 3>& at, unsigned axis) {
    if (at[axis] == 0 && o.goes_on(axis, false)) begin[axis] -= kOverlap;
    if (std::int64_t{at[axis]} + end[axis] == o.end[axis] && o.goes_on(axis, true)) end[axis] += kOverlap;
  }
};

}  // namespace mapcodec::surface
