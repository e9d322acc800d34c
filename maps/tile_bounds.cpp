// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/tile_bounds.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

struct Grid {
  Vec3 low;
  double cell;
  Vec3 slack;  // a few units in the last place, so that rounding of the grid itself never cuts a point off
};

Grid grid_of(const TileKey& key, std::uint8_t reach, const Vec3& origin, double tile_size_m) {
  const Box cube = tile_cube(key, origin, tile_size_m);
  const double side =
      std::ldexp(tile_size_m, key.level);  // not by subtraction: far from the origin that loses digits
  const double cell = std::ldexp(side / 14, reach);
  Vec3 low, slack;
  for (std::size_t d = 0; d < 3; ++d) {
    low[d] = cube.min[d] + 0.5 * side - 8 * cell;
    slack[d] = 8e-16 * (std::abs(origin[d]) + std::abs(cube.min[d]) + std::abs(cube.max[d]) + 16 * cell);
  }
  return {low, cell, slack};
}

double low_edge(const Grid& grid, std::size_t d, int cell) {
  return grid.low[d] + cell * grid.cell - grid.slack[d];
}
double high_edge(const Grid& grid, std::size_t d, int cell) {
  return grid.low[d] + (cell + 1) * grid.cell + grid.slack[d];
}

/// First and last cell that cover [low, high] on one axis; nothing if the grid is too small.
std::optional<std::uint8_t> cover(const Grid& grid, std::size_t d, double low, double high) {
  if (low < low_edge(grid, d, 0) || high > high_edge(grid, d, 15)) return std::nullopt;
  int first = 15, last = 0;
  while (low < low_edge(grid, d, first)) --first;
  while (high > high_edge(grid, d, last)) ++last;
  first = std::min(first, last);
  return static_cast<std::uint8_t>(first << 4 | last);
}

}  // namespace

std::optional<BoundsCode> encode_bounds(const Box& bounds, const TileKey& key, const Vec3& origin,
                                        double tile_size_m) {
  if (key.is_unplaced() || bounds.empty()) return BoundsCode{};
  if (!is_finite(bounds.min) || !is_finite(bounds.max)) return std::nullopt;
  for (std::uint8_t reach = 0; reach <= kMaxReach; ++reach) {
    const Grid grid = grid_of(key, reach, origin, tile_size_m);
    BoundsCode code{reach, {}};
    bool fits = true;
    for (std::size_t d = 0; d < 3 && fits; ++d) {
      const auto axis = cover(grid, d, bounds.min[d], bounds.max[d]);
      fits = axis.has_value();
      code.axis[d] = axis.value_or(0);
    }
    if (fits) return code;
  }
  return std::nullopt;
}

Box decode_bounds(const BoundsCode& code, const TileKey& key, const Vec3& origin, double tile_size_m) {
  if (key.is_unplaced()) return {};
  const Grid grid = grid_of(key, code.reach, origin, tile_size_m);
  Box box;
  for (std::size_t d = 0; d < 3; ++d) {
    box.min[d] = low_edge(grid, d, code.axis[d] >> 4);
    box.max[d] = high_edge(grid, d, code.axis[d] & 15);
  }
  return box;
}

bool is_valid(const BoundsCode& code) {
  return code.reach <= kMaxReach &&
         std::all_of(code.axis.begin(), code.axis.end(), [](std::uint8_t a) { return (a >> 4) <= (a & 15); });
}

}  // namespace mapcodec
