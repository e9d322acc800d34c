// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <compare>
#include <cstdint>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// One axis-aligned cube of a map: side = tile_size * 2^level, minimum corner = (x, y, z) * side in the map
/// frame (plus the map's origin). Tiles of one map do not overlap. `kUnplaced` holds points without a finite
/// position.
struct TileKey {
  std::int32_t x = 0, y = 0, z = 0;
  std::uint8_t level = 0;

  static constexpr std::uint8_t kUnplacedLevel = 255;
  [[nodiscard]] static constexpr TileKey unplaced() { return {0, 0, 0, kUnplacedLevel}; }
  [[nodiscard]] constexpr bool is_unplaced() const { return level == kUnplacedLevel; }

  bool operator==(const TileKey&) const = default;
};

/// Cube of `key` in a map with the given origin and level-0 tile size [m].
[[nodiscard]] inline Box tile_cube(const TileKey& key, const Vec3& origin, double tile_size_m) {
  const double side = std::ldexp(tile_size_m, key.level);
  const Vec3 lo{origin[0] + key.x * side, origin[1] + key.y * side, origin[2] + key.z * side};
  return {lo, {lo[0] + side, lo[1] + side, lo[2] + side}};
}

/// Morton order of the tiles' minimum corners; a larger tile before the smaller ones with the same corner.
/// The order in which tiles are stored and decoded; unplaced tiles come last.
[[nodiscard]] std::strong_ordering compare_morton(const TileKey& a, const TileKey& b);

struct MortonLess {
  bool operator()(const TileKey& a, const TileKey& b) const { return compare_morton(a, b) < 0; }
};

struct TileKeyHash {
  std::size_t operator()(const TileKey& k) const {
    std::uint64_t h = (std::uint64_t(std::uint32_t(k.x)) * 0x9E3779B97F4A7C15u) ^
                      (std::uint64_t(std::uint32_t(k.y)) * 0xC2B2AE3D27D4EB4Fu) ^
                      (std::uint64_t(std::uint32_t(k.z)) * 0x165667B19E3779F9u) ^
                      (std::uint64_t(k.level) << 56);
    return static_cast<std::size_t>(h ^ (h >> 29));
  }
};

}  // namespace mapcodec
