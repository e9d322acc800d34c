// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/value_encoder.hpp"

#include <numeric>

#include "mapcodec/attribute/lattice_search.hpp"
#include "mapcodec/attribute/scalar_bits.hpp"
#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/attribute/value_coder.hpp"
#include "mapcodec/attribute/value_decoder.hpp"

namespace mapcodec {
namespace {

/// All components in coding order, as the coder wants them.
struct Work {
  std::vector<ComponentPlan> plans;
  std::vector<std::uint64_t> values;
  std::vector<std::uint64_t> escapes;
  std::vector<std::uint8_t> mask;

  [[nodiscard]] bool has_escapes() const {
    return std::any_of(plans.begin(), plans.end(), [](const ComponentPlan& p) { return p.escapes; });
  }
};

/// One component on its way to small integers.
struct Column {
  std::vector<std::uint64_t> keys;
  std::vector<std::uint8_t> escaped;  ///< empty: none
};

bool is_float(ScalarType t) {
  return t == ScalarType::f32 || t == ScalarType::f64;
}

double load_double(const Channel& v, std::size_t i, std::size_t c) {
  return visit_scalar(v.info.scalar,
                      [&](auto zero) { return static_cast<double>(v.get<decltype(zero)>(i, c)); });
}

std::vector<double> load_doubles(const Channel& v, std::size_t c) {
  std::vector<double> r(v.size());
  for (std::size_t i = 0; i < r.size(); ++i) r[i] = load_double(v, i, c);
  return r;
}

/// The k of each value on the lattice; those off it (or out of the bound) are escaped and repeat the key
/// before.
Column lattice_column(const ValueLattice& lattice, std::span<const double> values, double bound) {
  Column col{std::vector<std::uint64_t>(values.size()), std::vector<std::uint8_t>(values.size())};
  std::uint64_t last = kLatticeKeyBias;
  bool any = false, first = true;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto k = bound > 0 ? lattice.nearest(values[i]) : lattice.exactly(values[i]);
    const bool good = k && (bound <= 0 || std::abs(lattice.value(*k) - values[i]) <= bound);
    if (good) {
      last = static_cast<std::uint64_t>(*k) + kLatticeKeyBias;
      // Escaped ones before the first good one must not widen the range.
      if (first) std::fill(col.keys.begin(), col.keys.begin() + static_cast<std::ptrdiff_t>(i), last);
      first = false;
    }
    col.keys[i] = last;
    col.escaped[i] = !good;
    any = any || !good;
  }
  if (!any) col.escaped.clear();
  return col;
}

Column ordered_column(const Channel& v, std::size_t c) {
  Column col{std::vector<std::uint64_t>(v.size()), {}};
  for (std::size_t i = 0; i < v.size(); ++i) col.keys[i] = load_ordered(v, i, c);
  return col;
}

std::uint64_t span_of(const std::vector<std::uint64_t>& keys) {
  const auto [low, high] = std::minmax_element(keys.begin(), keys.end());
  return *high - *low;
}

/// Whether a lattice spends clearly fewer bits than the bits themselves.
bool pays(const Column& lattice, const Column& ordered) {
  const auto escaped =
      static_cast<std::size_t>(std::count(lattice.escaped.begin(), lattice.escaped.end(), 1));
  return escaped <= lattice.keys.size() / 8 &&
         std::bit_width(span_of(lattice.keys)) + 2 <= std::bit_width(span_of(ordered.keys));
}

/// Finds how a float component is best made integer.
Column float_column(const ChannelSchema& schema, const Channel& v, std::size_t c, ComponentPlan& plan) {
  Column ordered = ordered_column(v, c);
  const std::vector<double> values = load_doubles(v, c);
  const bool single = v.info.scalar == ScalarType::f32;
  const bool bounded = schema.kept == ChannelKept::bounded && schema.bound > 0;
  std::optional<ValueLattice> lattice;
  if (bounded) {
    lattice = ValueLattice{LatticeKind::uniform, 0, single, 2 * schema.bound, 0};
  } else {
    lattice = find_lattice(values, single, 0.1);
  }
  if (!lattice) return ordered;
  Column col = lattice_column(*lattice, values, bounded ? schema.bound : 0);
  if (!pays(col, ordered)) return ordered;
  plan.on_lattice = true;
  plan.lattice = *lattice;
  plan.escapes = !col.escaped.empty();
  return col;
}

/// Integers within a bound share a step; exact ones their greatest common divisor.
void choose_divisor(const ChannelSchema& schema, const Column& col, ComponentPlan& plan) {
  plan.base = *std::min_element(col.keys.begin(), col.keys.end());
  if (schema.kept == ChannelKept::bounded && !is_float(schema.info.scalar)) {
    plan.divisor = 2 * static_cast<std::uint64_t>(std::clamp(schema.bound, 0.0, 0x1p61)) + 1;
    return;
  }
  std::uint64_t g = 0;
  for (const std::uint64_t k : col.keys) {
    g = std::gcd(g, k - plan.base);
    if (g == 1) break;
  }
  plan.divisor = g == 0 ? 1 : g;
}

/// Few distinct values become ranks.
void choose_palette(std::vector<std::uint64_t>& u, ComponentPlan& plan) {
  if (plan.most < 4) return;
  std::vector<std::uint64_t> distinct;
  for (std::size_t i = 0; i < u.size(); ++i) {
    if (i > 0 && u[i] == u[i - 1]) continue;
    distinct.push_back(u[i]);
    if (distinct.size() < 4 * kMostPalette) continue;
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    if (distinct.size() > kMostPalette) return;
  }
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  if (distinct.size() > kMostPalette || distinct.size() > plan.most / 2 || distinct.size() * 16 > u.size())
    return;
  for (std::uint64_t& v : u) {
    v = static_cast<std::uint64_t>(std::lower_bound(distinct.begin(), distinct.end(), v) - distinct.begin());
  }
  plan.palette = std::move(distinct);
}

void add_component(const ChannelSchema& schema, const Channel& v, std::size_t rank, Work& work) {
  ComponentPlan& plan = work.plans[rank];
  const std::size_t c = component_at(v.info, rank), stride = work.plans.size();
  Column col = is_float(v.info.scalar) ? float_column(schema, v, c, plan) : ordered_column(v, c);
  choose_divisor(schema, col, plan);
  // divisor / 2 rounds to nearest; it is exact where the divisor divides.
  for (std::uint64_t& k : col.keys) {
    const std::uint64_t off = k - plan.base;
    k = off / plan.divisor + (off % plan.divisor > plan.divisor / 2);
  }
  plan.most = *std::max_element(col.keys.begin(), col.keys.end());
  choose_palette(col.keys, plan);
  for (std::size_t i = 0; i < v.size(); ++i) work.values[i * stride + rank] = col.keys[i];
  if (!plan.escapes) return;
  work.escapes.resize(work.values.size());
  work.mask.resize(work.values.size());
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (col.escaped[i] == 0) continue;
    work.mask[i * stride + rank] = 1;
    work.escapes[i * stride + rank] = load_ordered(v, i, c);
  }
}

Bytes code(Work& work, std::span<const VoxelCoord> voxels) {
  SymbolWriter side;
  ValueCoder<SymbolWriter>(side, work.plans, voxels, work.values, work.escapes, work.mask).run();
  return side.finish();
}

/// A run of points from the middle, on which choices are tried.
Work sample_of(const Work& work, std::size_t begin, std::size_t count) {
  const std::size_t stride = work.plans.size();
  const auto cut = [&](const auto& from) {
    using V = std::remove_cvref_t<decltype(from)>;
    if (from.empty()) return V{};
    const auto at = from.begin() + static_cast<std::ptrdiff_t>(begin * stride);
    return V(at, at + static_cast<std::ptrdiff_t>(count * stride));
  };
  return {work.plans, cut(work.values), cut(work.escapes), cut(work.mask)};
}

/// Sums of products of the components' deviations from a plain mean of the points around them.
using Moments = std::array<std::array<double, 4>, 4>;

Moments deviation_moments(const Work& sample, std::span<const VoxelCoord> voxels) {
  Moments sums{};
  const std::size_t stride = sample.plans.size(), used = std::min<std::size_t>(stride, 4);
  CausalNeighbors finder(voxels);
  for (std::uint32_t i = 0; i < voxels.size(); ++i) {
    const auto around = finder.find(i);
    if (around.empty()) continue;
    std::array<double, 4> d{};
    for (std::size_t c = 0; c < used; ++c) {
      double mean = 0;
      for (const auto& n : around) mean += static_cast<double>(sample.values[n.index * stride + c]);
      d[c] = static_cast<double>(sample.values[i * stride + c]) - mean / static_cast<double>(around.size());
    }
    for (std::size_t a = 0; a < used; ++a) {
      for (std::size_t b = 0; b <= a; ++b) sums[a][b] += d[a] * d[b];
    }
  }
  return sums;
}

/// Least squares for component `c` from those before it, by elimination on the (at most 3 x 3) normal
/// equations.
std::array<std::int8_t, 3> cross_terms(const Moments& sums, std::size_t c) {
  std::array<std::array<double, 4>, 3> m{};
  for (std::size_t a = 0; a < c; ++a) {
    for (std::size_t b = 0; b < c; ++b) m[a][b] = a >= b ? sums[a][b] : sums[b][a];
    m[a][a] += 1e-3 * m[a][a] + 1e-9;
    m[a][3] = sums[c][a];
  }
  for (std::size_t p = 0; p < c; ++p) {
    for (std::size_t a = 0; a < c; ++a) {
      if (a == p) continue;
      const double f = m[a][p] / m[p][p];
      for (std::size_t b = 0; b < 4; ++b) m[a][b] -= f * m[p][b];
    }
  }
  std::array<std::int8_t, 3> r{};
  for (std::size_t a = 0; a < c; ++a) {
    r[a] = static_cast<std::int8_t>(std::clamp(std::nearbyint(16 * m[a][3] / m[a][a]), -127.0, 127.0));
  }
  return r;
}

void choose_cross_terms(std::vector<ComponentPlan>& plans, const Work& sample,
                        std::span<const VoxelCoord> voxels) {
  if (plans.size() < 2) return;
  const Moments sums = deviation_moments(sample, voxels);
  for (std::size_t c = 1; c < std::min<std::size_t>(plans.size(), 4); ++c) {
    const bool narrow = std::all_of(plans.begin(), plans.begin() + static_cast<std::ptrdiff_t>(c) + 1,
                                    [](const ComponentPlan& p) { return p.most_coded() < kNarrow; });
    if (narrow) plans[c].cross = cross_terms(sums, c);
  }
}

void set_predictor(std::vector<ComponentPlan>& plans, Predictor p) {
  for (ComponentPlan& plan : plans) plan.predictor = p;
}

/// Tries each predictor on a sample.
void choose_predictor(Work& work, std::span<const VoxelCoord> voxels) {
  constexpr std::size_t kSample = 8192;
  const std::size_t count = std::min(kSample, voxels.size()), begin = (voxels.size() - count) / 2;
  const auto some = voxels.subspan(begin, count);
  Work sample = sample_of(work, begin, count);
  choose_cross_terms(work.plans, sample, some);
  sample.plans = work.plans;
  const bool nameable = std::all_of(work.plans.begin(), work.plans.end(),
                                    [](const ComponentPlan& p) { return p.most_coded() < 256; });
  std::size_t best = ~std::size_t{0};
  for (const Predictor p :
       {Predictor::neighbors, Predictor::previous, Predictor::none, Predictor::category}) {
    if (p == Predictor::category && (!nameable || work.plans.size() > 1)) continue;
    set_predictor(sample.plans, p);
    const std::size_t size = code(sample, some).size();
    if (size >= best) continue;
    best = size;
    set_predictor(work.plans, p);
  }
}

}  // namespace

Bytes encode_values(const ChannelSchema& schema, const Channel& values, std::span<const VoxelCoord> voxels,
                    Effort effort) {
  Work work;
  work.plans.resize(values.info.components);
  work.values.resize(values.size() * work.plans.size());
  for (std::size_t rank = 0; rank < work.plans.size(); ++rank) add_component(schema, values, rank, work);
  if (work.has_escapes()) {
    work.escapes.resize(work.values.size());
    work.mask.resize(work.values.size());
  }
  // Untried, all go by their neighbours.
  if (effort != Effort::fast) choose_predictor(work, voxels);
  ByteWriter out;
  for (const ComponentPlan& p : work.plans) write_plan(out, p);
  out.raw(code(work, voxels));
  return out.take();
}

}  // namespace mapcodec
