// SPDX-License-Identifier: GPL-3.0-or-later
// The box of a tile's points in three bytes (FORMAT.md, Bounds).
#pragma once

#include <array>
#include <optional>

#include "mapcodec/cloud/tile_key.hpp"

namespace mapcodec {

/// Cells of a grid over the tile's cube: sixteen a side, fourteen to the cube and one beyond each face, since
/// decoded points may lie just outside. With `reach` the grid is 2^reach times as large about the same
/// centre.
struct BoundsCode {
  std::uint8_t reach = 0;
  std::array<std::uint8_t, 3> axis{0x1E, 0x1E,
                                   0x1E};  ///< first cell in the high four bits, last cell in the low
  bool operator==(const BoundsCode&) const = default;
};

inline constexpr std::uint8_t kMaxReach = 60;

/// The smallest code whose box contains `bounds`. An empty box, or an unplaced tile, gets the default code.
/// Nothing if the bounds are not finite or beyond any reach.
[[nodiscard]] std::optional<BoundsCode> encode_bounds(const Box& bounds, const TileKey& key,
                                                      const Vec3& origin, double tile_size_m);
/// Contains every box that encodes to `code`. Empty for an unplaced tile. Pure.
[[nodiscard]] Box decode_bounds(const BoundsCode& code, const TileKey& key, const Vec3& origin,
                                double tile_size_m);
/// First cell not after the last, reach within its range.
[[nodiscard]] bool is_valid(const BoundsCode& code);

}  // namespace mapcodec
