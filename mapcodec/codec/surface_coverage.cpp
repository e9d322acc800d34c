// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_coverage.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace mapcodec::surface {
namespace {

constexpr unsigned kFinest = 4;  // log2 of half a step
constexpr std::uint64_t kAxisBits = 21;
constexpr double kFar = 1e30;

std::uint64_t key_of(std::int64_t x, std::int64_t y, std::int64_t z) {
  return static_cast<std::uint64_t>(x) | (static_cast<std::uint64_t>(y) << kAxisBits) |
         (static_cast<std::uint64_t>(z) << (2 * kAxisBits));
}
std::size_t hash_of(std::uint64_t key) {
  key *= 0x9e3779b97f4a7c15u;
  return static_cast<std::size_t>(key ^ (key >> 29));
}
/// Number of a cell in its block.
unsigned bit_of(std::int64_t x, std::int64_t y, std::int64_t z) {
  return static_cast<unsigned>((x & 3) | ((y & 3) << 2) | ((z & 3) << 4));
}

}  // namespace

std::uint64_t Coverage::Level::cells_of(std::uint64_t key) const {
  const std::size_t mask = table.size() - 1;
  for (std::size_t i = hash_of(key) & mask;; i = (i + 1) & mask) {
    if (table[i].key == key) return table[i].cells;
    if (table[i].key == kFree) return 0;
  }
}

Coverage::Coverage(std::span<const Units> points, unsigned depth) {
  for (unsigned side = std::min(kFinest, depth); side <= depth; ++side) {
    add_level(points, side);
    if (side > kFinest + 2 && levels_.back().table.size() <= 16) break;
  }
}

void Coverage::add_level(std::span<const Units> points, unsigned side) {
  // Morton order: what is in one block stands together.
  std::vector<Block> blocks;
  for (const Units& p : points) {
    const std::int64_t x = p[0] >> side, y = p[1] >> side, z = p[2] >> side;
    const std::uint64_t key = key_of(x >> 2, y >> 2, z >> 2);
    if (blocks.empty() || blocks.back().key != key) blocks.push_back({key, 0});
    blocks.back().cells |= std::uint64_t{1} << bit_of(x, y, z);
  }
  Level level{side, std::vector<Block>(std::bit_ceil(2 * blocks.size() + 2))};
  const std::size_t mask = level.table.size() - 1;
  for (const Block& b : blocks) {
    std::size_t i = hash_of(b.key) & mask;
    while (level.table[i].key != kFree) i = (i + 1) & mask;
    level.table[i] = b;
  }
  levels_.push_back(std::move(level));
}

double Coverage::squared_distance(const std::array<double, 3>& place, double covered) {
  // Cells much smaller than the distance that does not matter need no look.
  const int fine = std::ilogb(covered) / 2 - static_cast<int>(levels_.front().side) - 1;
  const auto first = static_cast<std::size_t>(std::clamp(fine, 0, static_cast<int>(levels_.size()) - 1));
  const unsigned side = levels_[first].side;
  const std::int64_t x = static_cast<std::int64_t>(place[0]) >> side,
                     y = static_cast<std::int64_t>(place[1]) >> side,
                     z = static_cast<std::int64_t>(place[2]) >> side;
  if (x >= 0 && y >= 0 && z >= 0 &&
      ((levels_[first].cells_of(key_of(x >> 2, y >> 2, z >> 2)) >> bit_of(x, y, z)) & 1) != 0) {
    return 0;
  }
  // Half a cell is near enough: what is asked is whether there is anything at all.
  const unsigned shift = side > 0 ? side - 1 : 0;
  std::array<std::int64_t, 3> p;
  for (std::size_t d = 0; d < 3; ++d) p[d] = static_cast<std::int64_t>(std::max(0.0, place[d])) >> shift;
  const std::uint64_t key = key_of(p[0], p[1], p[2]) ^ (static_cast<std::uint64_t>(first) << 58);
  Known& known = known_[hash_of(key) & (kKnown - 1)];
  if (known.key != key) {
    for (std::size_t d = 0; d < 3; ++d) p[d] = (p[d] << shift) + (std::int64_t{1} << shift) / 2;
    known = {key, static_cast<float>(search(p, first))};
  }
  return known.squared < covered ? 0 : known.squared;
}

double Coverage::search(const std::array<std::int64_t, 3>& p, std::size_t first) const {
  for (std::size_t l = first; l < levels_.size(); ++l) {
    // The eight cells around the corner of the cell grid that is nearest to the place.
    const Level& level = levels_[l];
    const std::int64_t half = (std::int64_t{1} << level.side) / 2;
    std::array<std::int64_t, 3> low;
    for (std::size_t d = 0; d < 3; ++d) low[d] = (p[d] - half) >> level.side;
    double best = kFar;
    std::uint64_t last_key = kFree, cells = 0;
    for (int i = 0; i < 8; ++i) {
      const std::int64_t x = low[0] + (i & 1), y = low[1] + ((i >> 1) & 1), z = low[2] + (i >> 2);
      if (x < 0 || y < 0 || z < 0) continue;
      const std::uint64_t key = key_of(x >> 2, y >> 2, z >> 2);
      if (key != last_key) {
        cells = level.cells_of(key);
        last_key = key;
      }
      if (((cells >> bit_of(x, y, z)) & 1) == 0) continue;
      const double dx = static_cast<double>((x << level.side) + half - p[0]);
      const double dy = static_cast<double>((y << level.side) + half - p[1]);
      const double dz = static_cast<double>((z << level.side) + half - p[2]);
      best = std::min(best, dx * dx + dy * dy + dz * dz);
    }
    if (best < kFar) return best;
  }
  return kFar;
}

}  // namespace mapcodec::surface
