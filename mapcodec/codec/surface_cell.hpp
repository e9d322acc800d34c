// SPDX-License-Identifier: GPL-3.0-or-later
// A cell of the surface tree as the encoder sees it: with its points.
#pragma once

#include <algorithm>
#include <span>

#include "mapcodec/codec/surface_moments.hpp"

namespace mapcodec::surface {

inline constexpr double kStep2 = double(kStepUnits) * kStepUnits;  ///< a squared surface step [units^2]
inline constexpr double kNever = 1e300;                            ///< an error that nobody can want

/// Points [begin, end) of a Morton-sorted tile, all inside the cell at `at`.
struct TreeCell {
  std::size_t begin, end;
  std::array<std::uint32_t, 3> at;
  CellShape shape;
  unsigned level;

  [[nodiscard]] std::uint32_t count() const { return static_cast<std::uint32_t>(end - begin); }
  [[nodiscard]] unsigned axis() const { return level % 3; }
  [[nodiscard]] Units twice_center() const {
    Units c;
    for (unsigned d = 0; d < 3; ++d) c[d] = static_cast<std::int32_t>(2 * at[d] + (1u << shape[d]));
    return c;
  }
  /// Where the upper half begins along axis().
  [[nodiscard]] std::uint32_t border() const { return at[axis()] + (1u << (shape[axis()] - 1)); }
  /// Index of the first point in the upper half.
  [[nodiscard]] std::size_t first_above(std::span<const Units> points) const {
    const auto mine = points.subspan(begin, end - begin);
    const auto it = std::partition_point(mine.begin(), mine.end(), [&](const Units& p) {
      return static_cast<std::uint32_t>(p[axis()]) < border();
    });
    return begin + static_cast<std::size_t>(it - mine.begin());
  }
  [[nodiscard]] TreeCell half(bool upper, std::size_t split) const {
    TreeCell child{upper ? split : begin, upper ? end : split, at, shape, level + 1};
    if (upper) child.at[axis()] = border();
    --child.shape[axis()];
    return child;
  }
};

/// Which halves hold points, as Models::halves codes it: 0 both, 1 the lower, 2 the upper one.
[[nodiscard]] inline int halves_of(const TreeCell& cell, std::size_t split) {
  return split == cell.begin ? 2 : (split == cell.end ? 1 : 0);
}

}  // namespace mapcodec::surface
