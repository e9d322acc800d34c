// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/tile_neighbors.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

TileKey parent_of(const TileKey& k) {
  return {k.x >> 1, k.y >> 1, k.z >> 1, static_cast<std::uint8_t>(k.level + 1)};
}

std::vector<TileKey> keys_of(const TileSet& tiles) {
  std::vector<TileKey> keys;
  for (const TileSet::Entry& t : tiles.tiles()) keys.push_back(t.key);
  return keys;
}

}  // namespace

TileNeighbors::TileNeighbors(const TileSet& tiles, const Vec3& origin, double tile_size_m)
    : TileNeighbors(keys_of(tiles), origin, tile_size_m) {}

TileNeighbors::TileNeighbors(std::span<const TileKey> tiles, const Vec3& origin, double tile_size_m)
    : origin_(origin), tile_size_m_(tile_size_m) {
  for (const TileKey& key : tiles) {
    if (key.is_unplaced()) continue;
    tiles_.insert(key);
    highest_ = std::max(highest_, key.level);
  }
  for (const TileKey& tile : tiles_) {
    for (TileKey k = tile; k.level < highest_ && around_tiles_.insert(parent_of(k)).second;) k = parent_of(k);
  }
}

bool TileNeighbors::is_occupied(TileKey key) const {
  if (around_tiles_.count(key) != 0) return true;
  for (;; key = parent_of(key)) {
    if (tiles_.count(key) != 0) return true;
    if (key.level >= highest_) return false;
  }
}

TileBorders TileNeighbors::borders_of(const TileKey& key) const {
  TileBorders b;
  if (key.is_unplaced()) return b;
  b.cube = tile_cube(key, origin_, tile_size_m_);
  for (unsigned face = 0; face < 6; ++face) {
    TileKey beside = key;
    std::int32_t& at = face < 2 ? beside.x : (face < 4 ? beside.y : beside.z);
    at += face % 2 == 0 ? -1 : 1;
    if (is_occupied(beside)) b.occupied |= static_cast<std::uint8_t>(1u << face);
  }
  return b;
}

}  // namespace mapcodec
