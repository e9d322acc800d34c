// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_blocks.hpp"

#include <bit>

namespace mapcodec::surface {
namespace {

std::uint64_t key_of(std::int64_t x, std::int64_t y, std::int64_t z) {
  return static_cast<std::uint64_t>(x) | (static_cast<std::uint64_t>(y) << 21) |
         (static_cast<std::uint64_t>(z) << 42);
}
std::size_t hash_of(std::uint64_t key) {
  key *= 0x9e3779b97f4a7c15u;
  return static_cast<std::size_t>(key ^ (key >> 29));
}
unsigned bit_of(std::int64_t x, std::int64_t y, std::int64_t z) {
  return static_cast<unsigned>((x & 3) | ((y & 3) << 2) | ((z & 3) << 4));
}

/// [axis][i]: the voxels of a cube within two of its voxel i - 2 along an axis.
constexpr auto kSlabs = [] {
  std::array<std::array<std::uint64_t, 8>, 3> t{};
  for (int voxel = 0; voxel < 64; ++voxel) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int i = 0; i < 8; ++i) {
        const int off = ((voxel >> (2 * axis)) & 3) - (i - 2);
        if (off >= -2 && off <= 2)
          t[static_cast<std::size_t>(axis)][static_cast<std::size_t>(i)] |= std::uint64_t{1} << voxel;
      }
    }
  }
  return t;
}();
/// @param at  of a voxel in a cube's terms, in [-2, 5].
std::size_t window(std::int64_t at) {
  return static_cast<std::size_t>(at + 2);
}

/// Sums over the neighbours' offsets [voxels].
struct Sums {
  std::int64_t n = 0;
  std::array<std::int32_t, 3> first{};
  std::array<std::array<std::int32_t, 3>, 3> second{};
  void add(const std::array<std::int32_t, 3>& o) {
    ++n;
    for (unsigned d = 0; d < 3; ++d) {
      first[d] += o[d];
      for (unsigned e = 0; e < 3; ++e) second[d][e] += o[d] * o[e];
    }
  }
  /// n^2 times the covariance.
  [[nodiscard]] std::int64_t covariance(unsigned d, unsigned e) const {
    return n * second[d][e] - std::int64_t{first[d]} * first[e];
  }
};

constexpr int kSlopeBits = 12;

struct Fit {
  std::int64_t a = 0, b = 0, h = 0;  ///< slopes, and the height at the voxel's centre, in 1/4096 voxels
  std::int64_t residual = 0;         ///< n^2 times the mean squared distance, in 1/4096
};

Fit fit_along(const Sums& s, unsigned k) {
  const unsigned u = (k + 1) % 3, v = (k + 2) % 3;
  // A sixth of a squared voxel more on the diagonal: few voxels in a row tell nothing across it.
  const std::int64_t ridge = s.n * s.n / 6 + 1;
  const std::int64_t uu = s.covariance(u, u) + ridge, vv = s.covariance(v, v) + ridge,
                     uv = s.covariance(u, v);
  const std::int64_t uz = s.covariance(u, k), vz = s.covariance(v, k), zz = s.covariance(k, k);
  const std::int64_t det = uu * vv - uv * uv;
  Fit f;
  f.a = ((uz * vv - vz * uv) << kSlopeBits) / det;
  f.b = ((vz * uu - uz * uv) << kSlopeBits) / det;
  f.h = ((std::int64_t{s.first[k]} << kSlopeBits) - f.a * s.first[u] - f.b * s.first[v]) / s.n;
  const std::int64_t vertical = (zz << kSlopeBits) - f.a * uz - f.b * vz;
  f.residual = (vertical << kSlopeBits) / ((1 << kSlopeBits) + ((f.a * f.a + f.b * f.b) >> kSlopeBits));
  return f;
}

/// Area of the plane's piece in its voxel, in any unit.
std::uint64_t weight_of(const Leaf& leaf) {
  const Polygon polygon = polygon_of(leaf.plane, leaf.shape, Room::whole(leaf.shape));
  if (polygon.size < 3) return 1;
  const std::int64_t half = half_side(leaf.shape[0]);
  const std::int64_t a = (std::int64_t{leaf.plane.a} << 8) / half,
                     b = (std::int64_t{leaf.plane.b} << 8) / half;
  const std::int64_t stretch = 256 + ((a * a + b * b) >> 10);  // 1 + slope^2 / 4: of sqrt(1 + slope^2)
  const std::int64_t area = (twice_area(polygon) >> 16) * stretch;
  return area < 1 ? 1 : static_cast<std::uint64_t>(area);
}

}  // namespace

void VoxelSet::reserve(std::size_t count) {
  std::size_t size = 16;
  while (size < 2 * count) size *= 2;
  table_.assign(size, Cube{});
}

void VoxelSet::insert(const std::array<std::uint32_t, 3>& at) {
  const std::int64_t x = at[0] >> v_, y = at[1] >> v_, z = at[2] >> v_;
  const std::uint64_t key = key_of(x >> 2, y >> 2, z >> 2);
  const std::size_t mask = table_.size() - 1;
  std::size_t i = hash_of(key) & mask;
  while (table_[i].key != kFree && table_[i].key != key) i = (i + 1) & mask;
  table_[i].key = key;
  table_[i].cells |= std::uint64_t{1} << bit_of(x, y, z);
}

std::uint64_t VoxelSet::cells_of(std::uint64_t key) const {
  const std::size_t mask = table_.size() - 1;
  for (std::size_t i = hash_of(key) & mask;; i = (i + 1) & mask) {
    if (table_[i].key == key) return table_[i].cells;
    if (table_[i].key == kFree) return 0;
  }
}

Plane VoxelSet::fit(const std::array<std::uint32_t, 3>& at) const {
  const std::int64_t x = at[0] >> v_, y = at[1] >> v_, z = at[2] >> v_;
  Sums sums;
  // Five voxels along an axis lie in two cubes.
  const std::int64_t x0 = (x - 2) >> 2, y0 = (y - 2) >> 2, z0 = (z - 2) >> 2;
  for (std::int64_t cz = std::max<std::int64_t>(z0, 0); cz <= z0 + 1; ++cz) {
    const std::uint64_t in_z = kSlabs[2][window(z - 4 * cz)];
    for (std::int64_t cy = std::max<std::int64_t>(y0, 0); cy <= y0 + 1; ++cy) {
      const std::uint64_t in_zy = in_z & kSlabs[1][window(y - 4 * cy)];
      for (std::int64_t cx = std::max<std::int64_t>(x0, 0); cx <= x0 + 1; ++cx) {
        std::uint64_t cells = cells_of(key_of(cx, cy, cz)) & in_zy & kSlabs[0][window(x - 4 * cx)];
        for (; cells != 0; cells &= cells - 1) {
          const std::int64_t bit = std::countr_zero(cells);
          const auto dx = static_cast<std::int32_t>(4 * cx + (bit & 3) - x);
          const auto dy = static_cast<std::int32_t>(4 * cy + ((bit >> 2) & 3) - y);
          const auto dz = static_cast<std::int32_t>(4 * cz + (bit >> 4) - z);
          if (dx * dx + dy * dy + dz * dz <= 4) sums.add({dx, dy, dz});
        }
      }
    }
  }
  Plane plane;
  if (sums.n == 0) return plane;
  Fit best;
  for (unsigned k = 0; k < 3; ++k) {
    const Fit f = fit_along(sums, k);
    if (k == 0 || f.residual < best.residual) {
      best = f;
      plane.axis = static_cast<std::uint8_t>(k);
    }
  }
  const std::int64_t side = half_side(static_cast<std::uint8_t>(v_)) * 2;
  plane.h = clamp_height((best.h * side) >> kSlopeBits);
  plane.a = clamp_height((best.a * (side / 2)) >> kSlopeBits);
  plane.b = clamp_height((best.b * (side / 2)) >> kSlopeBits);
  return plane;
}

namespace {

/// All voxels that hold something: those told, and those that other leaves' points lie in.
VoxelSet occupied(const std::vector<Leaf>& leaves, int v, std::span<const SubUnits> others) {
  std::vector<std::array<std::uint32_t, 3>> corners;
  for (const Leaf& l : leaves) {
    if (l.block >= 0) corners.push_back(l.at);
  }
  const int shift = v + kSubUnitBits;
  for (const SubUnits& p : others) {
    std::array<std::uint32_t, 3> at;
    for (std::size_t d = 0; d < 3; ++d) at[d] = static_cast<std::uint32_t>(p[d] < 0 ? 0 : p[d] >> shift) << v;
    if (corners.empty() || corners.back() != at) corners.push_back(at);
  }
  VoxelSet set(v);
  set.reserve(corners.size());
  for (const auto& at : corners) set.insert(at);
  return set;
}

}  // namespace

std::vector<SubUnits> spread_leaves(std::vector<Leaf>& leaves, std::span<const Block> blocks, int v,
                                    std::size_t count, const Surroundings& around) {
  std::vector<SubUnits> points;
  points.reserve(count);
  std::vector<Vertex> scratch;
  for (const Leaf& l : leaves) {
    if (l.block < 0) append_points(l, around, scratch, points);
  }
  if (blocks.empty()) return points;
  settle_blocks(leaves, blocks, v, points);
  for (const Leaf& l : leaves) {
    if (l.block >= 0) append_points(l, around, scratch, points);
  }
  return points;
}

void settle_blocks(std::vector<Leaf>& leaves, std::span<const Block> blocks, int v,
                   std::span<const SubUnits> others) {
  const VoxelSet voxels = occupied(leaves, v, others);
  struct Share {
    std::uint64_t weight = 0, before = 0;
    std::uint32_t voxels = 0, given = 0;
  };
  std::vector<Share> shares(blocks.size());
  for (Leaf& l : leaves) {
    if (l.block < 0) continue;
    l.plane = voxels.fit(l.at);
    l.has_plane = true;
    Share& s = shares[static_cast<std::size_t>(l.block)];
    s.weight += weight_of(l);
    ++s.voxels;
  }
  for (Leaf& l : leaves) {
    if (l.block < 0) continue;
    Share& s = shares[static_cast<std::size_t>(l.block)];
    const Block& block = blocks[static_cast<std::size_t>(l.block)];
    const std::uint32_t n = block.count;
    l.noise = block.noise;
    // One point each where there are enough; the rest by area, rounded along the way so that the sum is
    // exact.
    const std::uint32_t base = n >= s.voxels ? 1 : 0;
    const std::uint64_t rest = n - std::uint64_t{base} * s.voxels;
    s.before += weight_of(l);
    const auto upto = static_cast<std::uint32_t>(s.before * rest / s.weight);
    l.count = base + upto - s.given;
    s.given = upto;
  }
}

}  // namespace mapcodec::surface
