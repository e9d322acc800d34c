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
// With fewer points to a block its cells are finer than anything that can be known.
constexpr std::size_t kLeastInBlock = 1;

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

/// The cells of a block that lie on its lower or upper face, per axis, as bits.
constexpr std::array<std::uint64_t, 3> kLowFace{0x1111111111111111u, 0x000f000f000f000fu, 0xffffu};
constexpr std::array<std::uint64_t, 3> kHighFace{0x8888888888888888u, 0xf000f000f000f000u,
                                                 0xffff000000000000u};

/// The cells of a block at `from` and from + 1 along an axis, where from is in [-1, 3].
std::uint64_t two_of(unsigned axis, std::int64_t from) {
  const unsigned step = 2 * axis;
  if (from < 0) return kLowFace[axis];
  if (from > 2) return kHighFace[axis];
  return (kLowFace[axis] | kLowFace[axis] << (1u << step)) << (static_cast<unsigned>(from) << step);
}

/// What the cells of one block touch along one axis, in the block at `to` = -1, 0 or 1 along it.
std::uint64_t touched(std::uint64_t cells, unsigned axis, int to) {
  const unsigned step = 2 * axis, one = 1u << step, across = 3u << step;
  if (to < 0) return (cells & kLowFace[axis]) << across;
  if (to > 0) return (cells & kHighFace[axis]) >> across;
  return cells | ((cells & ~kHighFace[axis]) << one) | ((cells & ~kLowFace[axis]) >> one);
}

}  // namespace

void Coverage::Table::reserve(std::size_t blocks) {
  slots_.assign(std::bit_ceil(blocks + blocks / 4 + 2), Block{});
}

std::size_t Coverage::Table::slot(std::uint64_t key) const {
  const std::size_t mask = slots_.size() - 1;
  std::size_t i = hash_of(key) & mask;
  while (slots_[i].key != kFree && slots_[i].key != key) i = (i + 1) & mask;
  return i;
}

void Coverage::Table::add(std::uint64_t key, std::uint64_t cells) {
  Block& b = slots_[slot(key)];
  b.key = key;
  b.cells |= cells;
}

std::uint64_t Coverage::Table::cells_at(std::uint64_t key) {
  if (slots_[last_].key != key) last_ = slot(key);
  return slots_[last_].cells;
}

void Coverage::Level::spread(const Block& from) {
  constexpr std::int64_t kMask = (std::int64_t{1} << kAxisBits) - 1;
  const auto key = static_cast<std::int64_t>(from.key);
  const std::int64_t x = key & kMask, y = (key >> kAxisBits) & kMask, z = key >> (2 * kAxisBits);
  for (int dz = -1; dz <= 1; ++dz) {
    const std::uint64_t in_z = touched(from.cells, 2, dz);
    if (in_z == 0 || z + dz < 0) continue;
    for (int dy = -1; dy <= 1; ++dy) {
      const std::uint64_t in_y = touched(in_z, 1, dy);
      if (in_y == 0 || y + dy < 0) continue;
      for (int dx = -1; dx <= 1; ++dx) {
        const std::uint64_t in_x = touched(in_y, 0, dx);
        if (in_x == 0 || x + dx < 0) continue;
        near.add(key_of(x + dx, y + dy, z + dz), in_x);
      }
    }
  }
}

bool Coverage::Level::is_sparse(std::span<const Units> points, unsigned side) {
  std::size_t blocks = 1;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Units &p = points[i - 1], &q = points[i];
    blocks += (((p[0] ^ q[0]) | (p[1] ^ q[1]) | (p[2] ^ q[2])) >> (side + 2)) != 0;
  }
  return 3 * blocks * kLeastInBlock > 2 * points.size();
}

void Coverage::Level::build(std::span<const Units> points) {
  // Morton order: what is in one block stands together.
  std::vector<Block> blocks;
  for (const Units& p : points) {
    const std::int64_t x = p[0] >> side, y = p[1] >> side, z = p[2] >> side;
    const std::uint64_t key = key_of(x >> 2, y >> 2, z >> 2);
    if (blocks.empty() || blocks.back().key != key) blocks.push_back({key, 0});
    blocks.back().cells |= std::uint64_t{1} << bit_of(x, y, z);
  }
  std::size_t touching = 0;
  for (const Block& b : blocks) {
    int faces = 1;
    for (unsigned d = 0; d < 3; ++d)
      faces *= 1 + ((b.cells & kLowFace[d]) != 0) + ((b.cells & kHighFace[d]) != 0);
    touching += static_cast<std::size_t>(faces);
  }
  held.reserve(blocks.size());
  near.reserve(touching);
  for (const Block& b : blocks) {
    held.add(b.key, b.cells);
    spread(b);
  }
}

Coverage::Coverage(std::span<const Units> points, unsigned depth) : points_(points) {
  // The last level is one block, in which any place is near a point or far from all.
  unsigned side = std::min(kFinest, depth);
  while (side + 1 < depth && Level::is_sparse(points, side)) ++side;
  for (; side <= std::max(depth, kFinest); ++side) levels_.push_back({side, {}, {}});
}

Coverage::Level& Coverage::level(std::size_t l) {
  if (levels_[l].held.empty()) levels_[l].build(points_);
  return levels_[l];
}

std::size_t Coverage::first_level(double covered) const {
  // Cells much smaller than the distance that does not matter need no look.
  const int fine = std::ilogb(covered) / 2 - static_cast<int>(levels_.front().side) - 1;
  return static_cast<std::size_t>(std::clamp(fine, 0, static_cast<int>(levels_.size()) - 1));
}

bool Coverage::is_near(Level& level, const Cell& p) {
  const std::int64_t x = p[0] >> level.side, y = p[1] >> level.side, z = p[2] >> level.side;
  return ((level.near.cells_at(key_of(x >> 2, y >> 2, z >> 2)) >> bit_of(x, y, z)) & 1) != 0;
}

/// Squared distance to the middle of the nearest of the eight cells around the corner of the cell grid that
/// is nearest to the place.
double Coverage::nearest_of_eight(Level& level, const Cell& p) {
  const std::int64_t half = (std::int64_t{1} << level.side) / 2;
  Cell low;
  for (std::size_t d = 0; d < 3; ++d) low[d] = (p[d] - half) >> level.side;
  double best = kFar;
  // Mostly they are all in one block.
  for (std::int64_t z = low[2] >> 2; z <= (low[2] + 1) >> 2; ++z) {
    for (std::int64_t y = low[1] >> 2; y <= (low[1] + 1) >> 2; ++y) {
      for (std::int64_t x = low[0] >> 2; x <= (low[0] + 1) >> 2; ++x) {
        if (x < 0 || y < 0 || z < 0) continue;
        std::uint64_t cells = level.held.cells_at(key_of(x, y, z)) & two_of(0, low[0] - 4 * x) &
                              two_of(1, low[1] - 4 * y) & two_of(2, low[2] - 4 * z);
        for (; cells != 0; cells &= cells - 1) {
          const std::int64_t bit = std::countr_zero(cells);
          const auto dx = static_cast<double>(((4 * x + (bit & 3)) << level.side) + half - p[0]);
          const auto dy = static_cast<double>(((4 * y + ((bit >> 2) & 3)) << level.side) + half - p[1]);
          const auto dz = static_cast<double>(((4 * z + (bit >> 4)) << level.side) + half - p[2]);
          best = std::min(best, dx * dx + dy * dy + dz * dz);
        }
      }
    }
  }
  return best;
}

double Coverage::squared_distance(const std::array<double, 3>& place, double covered, std::size_t first) {
  Cell p;
  for (std::size_t d = 0; d < 3; ++d) p[d] = static_cast<std::int64_t>(std::max(0.0, place[d]));
  if (is_near(level(first), p)) return 0;
  for (std::size_t l = first + 1; l < levels_.size(); ++l) {
    if (!is_near(level(l), p)) continue;
    const double squared = nearest_of_eight(levels_[l], p);
    if (squared < kFar) return squared < covered ? 0 : squared;
  }
  return kFar;
}

double Coverage::sum_of_squared(std::span<const std::array<double, 3>> places, double covered, double most) {
  const std::size_t first = first_level(covered);
  double sum = 0;
  for (const auto& p : places) {
    sum += squared_distance(p, covered, first);
    if (sum > most) break;
  }
  return sum;
}

}  // namespace mapcodec::surface
