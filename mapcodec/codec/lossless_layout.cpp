// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/lossless_layout.hpp"

#include <algorithm>

#include "mapcodec/attribute/lattice_search.hpp"
#include "mapcodec/codec/octree_encoder.hpp"
#include "mapcodec/geometry/morton.hpp"

namespace mapcodec {
namespace {

// The finest cells looked at: 2^20 of them across a tile. Bases are multiples of it, so that coarser cells
// are aligned.
constexpr std::uint32_t kFineBits = 20;

// Numbers off their lattice ("-0.000" of a text file) are kept as patches; more of them would cost more than
// they save.
constexpr double kPatchedShare = 1.0 / 64;

struct Axis {
  std::vector<double> values;
  double min = 0, max = 0, largest = 0;  ///< largest magnitude
  int unit = 0;                          ///< lattice: binary logarithm of its unit
};

Axis load_axis(std::span<const Vec3> xyz, const std::vector<std::uint32_t>& finite, std::size_t d) {
  Axis a;
  a.values.reserve(finite.size());
  for (const std::uint32_t i : finite) a.values.push_back(xyz[i][d]);
  const auto [low, high] = std::minmax_element(a.values.begin(), a.values.end());
  a.min = *low == 0 ? -0.0 : *low;  // -0 lies in the lower cell
  a.max = *high == 0 ? 0.0 : *high;
  a.largest = std::max(std::abs(a.min), std::abs(a.max));
  return a;
}

bool all_single(const std::vector<double>& values) {
  constexpr double kMost = std::numeric_limits<float>::max();
  return std::all_of(values.begin(), values.end(), [](double x) {
    return std::abs(x) <= kMost &&
           std::bit_cast<std::uint64_t>(double{static_cast<float>(x)}) == std::bit_cast<std::uint64_t>(x);
  });
}

/// Mean binary logarithm of the distance of neighbouring floats at the values.
double mean_float_unit(const std::vector<double>& values, int mantissa) {
  double sum = 0;
  for (const double x : values) sum += x == 0 ? -40 : std::max(std::ilogb(x), -40);
  return sum / static_cast<double>(values.size()) - mantissa;
}

std::optional<ValueLattice> fixed_lattice(const std::vector<double>& values, const CoordinateFormat& format,
                                          std::size_t d) {
  if (format.kind != CoordinateFormat::Kind::fixed || !(format.scale[d] > 0)) return std::nullopt;
  const ValueLattice l{LatticeKind::fixed, 0, false, format.scale[d], format.offset[d]};
  const bool all =
      std::all_of(values.begin(), values.end(), [&](double x) { return l.exactly(x).has_value(); });
  return all ? std::optional(l) : std::nullopt;
}

AxisGrid choose_grid(Axis& axis, const CoordinateFormat& format, std::size_t d) {
  AxisGrid g;
  const bool single = format.kind == CoordinateFormat::Kind::f32 && all_single(axis.values);
  g.kind = single ? AxisGrid::Kind::f32 : AxisGrid::Kind::f64;
  std::optional<ValueLattice> lattice = fixed_lattice(axis.values, format, d);
  // A lattice rounded to float32 needs the format to say so.
  if (!lattice && (single || format.kind != CoordinateFormat::Kind::f32))
    lattice = find_lattice(axis.values, single, kPatchedShare);
  if (!lattice || !lattice->nearest(axis.min) || !lattice->nearest(axis.max)) return g;
  const double unit = std::log2(lattice->unit());
  if (unit < mean_float_unit(axis.values, g.mantissa()) + 0.5) return g;
  axis.unit = static_cast<int>(std::lround(unit));
  g.kind = AxisGrid::Kind::lattice;
  g.lattice = *lattice;
  return g;
}

/// Whether cells of 2^exponent metres number the axis within 2^kFineBits of each other and 2^53 in all.
bool fits(AxisGrid& g, const Axis& a, int exponent) {
  g.exponent = exponent;
  if (g.kind == AxisGrid::Kind::lattice) {
    g.exponent -= a.unit;
    if (g.exponent < -40 || g.exponent > g.most()) return false;
    const double k = std::abs(static_cast<double>(*g.lattice.nearest(a.min))),
                 l = std::abs(static_cast<double>(*g.lattice.nearest(a.max)));
    if (std::ldexp(std::max(k, l), -g.exponent) >= 0x1p51) return false;
  } else if (exponent > g.most() || exponent < AxisGrid::kLeast ||
             std::ldexp(a.largest, -exponent) >= 0x1p51) {
    return false;
  }
  return g.split(a.max).cell - g.split(a.min).cell < (std::int64_t{1} << kFineBits);
}

/// The smallest power of two [m] whose cells fit all axes.
void choose_fine_cells(std::array<AxisGrid, 3>& grids, const std::array<Axis, 3>& axes) {
  int exponent = AxisGrid::kLeast;
  const bool lattices = std::all_of(grids.begin(), grids.end(),
                                    [](const AxisGrid& g) { return g.kind == AxisGrid::Kind::lattice; });
  // Cells finer than the finest lattice would only waste levels.
  if (lattices) exponent = std::min({axes[0].unit, axes[1].unit, axes[2].unit});
  const auto all_fit = [&] {
    bool fit = true;
    for (std::size_t d = 0; d < 3; ++d) fit = fits(grids[d], axes[d], exponent) && fit;
    return fit;
  };
  while (!all_fit()) ++exponent;
}

void sort_points(LosslessLayout& layout, std::span<const Vec3> xyz,
                 const std::vector<std::uint32_t>& finite) {
  struct Entry {
    std::uint64_t key;
    std::uint32_t index;
  };
  std::vector<Entry> entries;
  entries.reserve(finite.size());
  for (const std::uint32_t i : finite) {
    VoxelCoord v{};
    for (std::size_t d = 0; d < 3; ++d) {
      v[d] = static_cast<std::uint32_t>(layout.grids[d].split(xyz[i][d]).cell - layout.base[d]);
    }
    entries.push_back({morton_encode(v), i});
  }
  std::sort(entries.begin(), entries.end(), [&](const Entry& a, const Entry& b) {
    if (a.key != b.key) return a.key < b.key;
    return xyz[a.index] != xyz[b.index] ? xyz[a.index] < xyz[b.index] : a.index < b.index;
  });
  for (const Entry& e : entries) {
    layout.order.push_back(e.index);
    layout.keys.push_back(e.key);
  }
}

/// The coarsest level of cells (0: the finest) at which nearly all points that are not equal have their own.
std::uint32_t separating_level(const LosslessLayout& layout) {
  std::array<std::size_t, kMortonBits + 2> splits{};
  for (std::size_t i = 1; i < layout.keys.size(); ++i) {
    const std::uint64_t differ = layout.keys[i] ^ layout.keys[i - 1];
    ++splits[static_cast<std::size_t>((std::bit_width(differ) + 2) / 3)];
  }
  // Pairs that the finest cells do not split never will be.
  const std::size_t whole = layout.keys.size() - splits[0];
  std::size_t cells = whole;
  std::uint32_t level = 0;
  while (level < kFineBits &&
         static_cast<double>(cells - splits[level + 1]) >= 0.95 * static_cast<double>(whole)) {
    cells -= splits[++level];
  }
  return level;
}

/// Bits that the octree and the bits below it take at `level`, for a run of keys.
double price(std::span<const std::uint64_t> some, std::uint32_t level, const std::array<AxisGrid, 3>& grids,
             Effort effort) {
  std::vector<std::uint64_t> keys;
  std::vector<std::uint32_t> counts;
  for (const std::uint64_t fine : some) {
    const std::uint64_t k = fine >> (3 * level);
    if (keys.empty() || keys.back() != k) {
      keys.push_back(k);
      counts.push_back(0);
    }
    ++counts.back();
  }
  const auto depth = static_cast<std::uint32_t>((std::bit_width(keys.front() ^ keys.back()) + 2) / 3);
  for (std::uint64_t& k : keys) k &= (std::uint64_t{1} << (3 * depth)) - 1;
  double bits = 8.0 * static_cast<double>(encode_octree(keys, counts, depth, {effort, true}).size());
  for (const AxisGrid& g : grids) {
    const int rest = g.exponent + static_cast<int>(level);
    // Floats have at least as many, and a level more costs each of them one.
    const bool counted = g.kind != AxisGrid::Kind::lattice || rest > 0;
    if (counted) bits += static_cast<double>(some.size()) * rest;
  }
  return bits;
}

/// How many levels of the finest cells to leave to plain bits. In noise an octree finds nothing more soon
/// after all points have cells of their own; numbers with a pattern (one camera's rays) show it only far
/// deeper.
std::uint32_t choose_level(const LosslessLayout& layout, Effort effort) {
  constexpr std::size_t kSample = 4096;
  const std::uint32_t level = separating_level(layout), near = level - std::min(level, 2u);
  if (effort == Effort::fast || level <= 4) return near;
  const std::size_t count = std::min(kSample, layout.keys.size());
  const auto some = std::span(layout.keys).subspan((layout.keys.size() - count) / 2, count);
  const std::uint32_t deep = level - std::min(level, 10u);
  // Deep trees are slow: they must save at least a bit a point.
  const double saved = price(some, near, layout.grids, effort) - price(some, deep, layout.grids, effort);
  return saved > static_cast<double>(count) ? deep : near;
}

void coarsen(LosslessLayout& layout, std::uint32_t level) {
  for (AxisGrid& g : layout.grids) level = std::min(level, static_cast<std::uint32_t>(g.most() - g.exponent));
  for (AxisGrid& g : layout.grids) g.exponent += static_cast<int>(level);
  for (std::int64_t& b : layout.base) b >>= level;
  for (std::uint64_t& k : layout.keys) k >>= 3 * level;
  // Levels that all points share are part of the base.
  layout.depth =
      static_cast<std::uint32_t>((std::bit_width(layout.keys.front() ^ layout.keys.back()) + 2) / 3);
  const std::uint64_t below = (std::uint64_t{1} << (3 * layout.depth)) - 1;
  const VoxelCoord corner = morton_decode(layout.keys.front() & ~below);
  for (std::size_t d = 0; d < 3; ++d) layout.base[d] += corner[d];
  for (std::uint64_t& k : layout.keys) k &= below;
}

}  // namespace

LosslessLayout lay_out_lossless(std::span<const Vec3> xyz, const std::vector<std::uint32_t>& finite,
                                const CoordinateFormat& format, Effort effort) {
  LosslessLayout layout;
  std::array<Axis, 3> axes;
  for (std::size_t d = 0; d < 3; ++d) {
    axes[d] = load_axis(xyz, finite, d);
    layout.grids[d] = choose_grid(axes[d], format, d);
  }
  choose_fine_cells(layout.grids, axes);
  for (std::size_t d = 0; d < 3; ++d) {
    layout.base[d] = layout.grids[d].split(axes[d].min).cell & ~((std::int64_t{1} << kFineBits) - 1);
  }
  sort_points(layout, xyz, finite);
  coarsen(layout, choose_level(layout, effort));
  return layout;
}

}  // namespace mapcodec
