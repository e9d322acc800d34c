// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/tile_directory.hpp"

#include <algorithm>

#include "parallel/voxel_histogram.hpp"

namespace mapcodec {
namespace {

TileKey parent(const TileKey& cell, std::uint8_t level) {
  const int up = level - cell.level;
  return {cell.x >> up, cell.y >> up, cell.z >> up, level};
}

}  // namespace

void TileDirectory::add(const TileKey& key) {
  tiles_.insert(key);
  if (key.is_unplaced()) return;
  if (std::find(levels_.begin(), levels_.end(), key.level) == levels_.end()) levels_.push_back(key.level);
  for (std::uint8_t l = key.level + 1; l <= new_level_; ++l) {
    if (!above_.insert(parent(key, l)).second) return;
  }
}

void TileDirectory::split(const TileKey& key) {
  tiles_.erase(key);
  above_.insert(key);
  last_cell_.reset();
}

std::optional<TileKey> TileDirectory::find(const TileKey& cell) const {
  for (const std::uint8_t l : levels_) {
    const TileKey key = parent(cell, l);
    if (tiles_.count(key) != 0) return key;
  }
  return std::nullopt;
}

std::optional<TileKey> TileDirectory::place(const Vec3& p) {
  if (!has_place(p)) return TileKey::unplaced();
  std::array<double, 3> cells{};
  for (std::size_t d = 0; d < 3; ++d) {
    cells[d] = std::floor((p[d] - origin_[d]) / tile_size_m_);
    if (!(std::abs(cells[d]) < 2147483648.0)) return std::nullopt;
  }
  const TileKey cell{static_cast<std::int32_t>(cells[0]), static_cast<std::int32_t>(cells[1]),
                     static_cast<std::int32_t>(cells[2]), 0};
  if (last_cell_ == cell) return last_;
  std::optional<TileKey> key = find(cell);
  for (int l = new_level_; !key && l >= 0; --l) {
    const TileKey cube = parent(cell, static_cast<std::uint8_t>(l));
    if (above_.count(cube) == 0) key = cube;
  }
  add(*key);
  last_cell_ = cell;
  return last_ = key;
}

}  // namespace mapcodec
