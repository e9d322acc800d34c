// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/grid_nearest.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "mapcodec/geometry/morton.hpp"
#include "mapcodec/geometry/radix_sort.hpp"

namespace mapcodec {
namespace {

constexpr int kMostBits = 20;              // cells across the grid, log2
constexpr std::size_t kPointsPerCell = 8;  // aimed at
constexpr std::size_t kCrowded = 128;      // mean over the points of how many share their cell
constexpr double kSlack = 1e-7;            // of a cell: more than rounding can move a point
constexpr double kMostCell = (1 << kMostBits) - 1;
constexpr double kFarthest = 6;  // cells that are looked at one by one

/// [axis][from][to]: the cells of a block of 4 x 4 x 4 with a coordinate in [from, to], as bits in Morton
/// order.
constexpr auto kSlabs = [] {
  std::array<std::array<std::array<std::uint64_t, 4>, 4>, 3> t{};
  for (std::uint32_t cell = 0; cell < 64; ++cell) {
    for (std::uint32_t d = 0; d < 3; ++d) {
      const std::uint32_t v = ((cell >> d) & 1) | (((cell >> (d + 3)) & 1) << 1);
      for (std::uint32_t from = 0; from <= v; ++from) {
        for (std::uint32_t to = v; to < 4; ++to) t[d][from][to] |= std::uint64_t{1} << cell;
      }
    }
  }
  return t;
}();

/// Without the instruction the compiler calls a function.
std::uint32_t count_bits(std::uint64_t v) {
  v -= (v >> 1) & 0x5555555555555555u;
  v = (v & 0x3333333333333333u) + ((v >> 2) & 0x3333333333333333u);
  v = (v + (v >> 4)) & 0x0f0f0f0f0f0f0f0fu;
  return static_cast<std::uint32_t>((v * 0x0101010101010101u) >> 56);
}

struct Best {
  double squared;
  std::uint32_t at;  ///< in the sorted points
};

double squared_distance(const Vec3& a, const Vec3& b) {
  const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return x * x + y * y + z * z;
}

}  // namespace

/// Two levels of cells: blocks of 4 x 4 x 4 in a hash table, each with a mask of the cells that hold points.
/// Above the blocks an octree, for queries with nothing near.
struct GridNearest::Impl {
  explicit Impl(std::span<const Vec3> points);

  [[nodiscard]] Best search(const Vec3& query, std::uint32_t hint) const;

  std::vector<Vec3> sorted;
  std::vector<std::uint32_t> ids;
  std::unique_ptr<NeighborIndex> tree;  ///< instead of all below, where too many points share a cell

 private:
  struct Block {
    std::uint64_t key, mask;
    std::uint32_t first;  ///< cell
  };
  struct Node {
    std::uint64_t key;
    std::uint32_t first;  ///< node of the level below, or block
  };
  /// A query in the grid's terms.
  struct Query {
    Vec3 at;
    std::array<double, 3> place;  ///< in cells
    std::array<std::int64_t, 3> cell;
  };

  void place_cells(std::span<const Vec3> points, int bits);
  [[nodiscard]] bool crowded() const;
  void build_cells(const std::vector<KeyedIndex>& keys, int shift);
  void build_table();
  void build_octree();
  [[nodiscard]] const Block* find(std::uint64_t key) const;
  void scan(std::size_t cell, const Query& q, Best& best) const;
  [[nodiscard]] bool look_around(const Query& q, Best& best) const;
  void scan_part(const Block& block, std::uint64_t part, const Query& q, Best& best) const;
  void descend(std::size_t level, std::uint32_t begin, std::uint32_t end, const Query& q, Best& best) const;
  [[nodiscard]] double squared_to(std::uint64_t key, int level, const Query& q) const;

  Vec3 corner_{};
  double side_ = 1, per_side_ = 1;
  bool finest_ = false;               ///< cells could not be coarser
  std::vector<std::uint32_t> cells_;  ///< first point of each, and the end
  std::vector<Block> blocks_;
  struct Slot {
    std::uint64_t key = kFree;
    std::uint32_t block = 0;
  };
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};
  std::vector<Slot> table_;
  std::vector<std::vector<Node>> levels_;  ///< [0] joins blocks, the last is one node
};

GridNearest::Impl::Impl(std::span<const Vec3> points) {
  const int bits = std::clamp((static_cast<int>(std::bit_width(points.size())) + 1) / 2 + 2, 4, kMostBits);
  place_cells(points, bits);
  if (crowded() && finest_ && bits < kMostBits) place_cells(points, kMostBits);
  if (crowded()) {
    tree = std::make_unique<NeighborIndex>(sorted);
    return;
  }
  build_table();
  build_octree();
}

/// Whether so many points share cells that looking at all of a cell takes too long: equal ones, or a few far
/// away.
bool GridNearest::Impl::crowded() const {
  double crowd = 0;
  for (std::size_t c = 0; c + 1 < cells_.size(); ++c) {
    const double n = cells_[c + 1] - cells_[c];
    crowd += n * n;
  }
  return crowd > double(kCrowded * sorted.size()) + 1e4;
}

void GridNearest::Impl::place_cells(std::span<const Vec3> points, int bits) {
  Box box;
  for (const Vec3& p : points) box.add(p);
  double extent = 0;
  for (std::size_t d = 0; d < 3; ++d) extent = std::max(extent, box.max[d] - box.min[d]);
  corner_ = box.min;
  side_ = extent > 0 && std::isnormal(extent) ? extent / double(1 << bits) : 1;
  const double most = double(1 << bits) - 1;
  std::vector<KeyedIndex> keys(points.size()), scratch;
  for (std::size_t i = 0; i < points.size(); ++i) {
    VoxelCoord c;
    for (std::size_t d = 0; d < 3; ++d) {
      c[d] = static_cast<std::uint32_t>(std::min(most, (points[i][d] - corner_[d]) / side_));
    }
    keys[i] = {morton_encode(c), static_cast<std::uint32_t>(i)};
  }
  radix_sort(keys, scratch, 3 * bits);
  ids.clear();
  sorted.clear();
  ids.reserve(points.size());
  sorted.reserve(points.size());
  for (const KeyedIndex& k : keys) {
    ids.push_back(k.index);
    sorted.push_back(points[k.index]);
  }
  // The coarsest cells with not many points each.
  std::array<std::size_t, kMostBits + 2> parts{};
  for (std::size_t i = 1; i < keys.size(); ++i) {
    ++parts[static_cast<std::size_t>((std::bit_width(keys[i].key ^ keys[i - 1].key) + 2) / 3)];
  }
  std::size_t cells = points.size() - parts[0];
  int shift = 0;
  while (shift < bits &&
         (cells - parts[static_cast<std::size_t>(shift) + 1]) * kPointsPerCell >= points.size()) {
    cells -= parts[static_cast<std::size_t>(++shift)];
  }
  finest_ = shift == 0;
  side_ *= double(1 << shift);
  per_side_ = 1 / side_;
  build_cells(keys, shift);
}

void GridNearest::Impl::build_cells(const std::vector<KeyedIndex>& keys, int shift) {
  cells_.clear();
  blocks_.clear();
  std::uint64_t last = ~std::uint64_t{0};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::uint64_t key = keys[i].key >> (3 * shift);
    if (key == last) continue;
    last = key;
    if (blocks_.empty() || blocks_.back().key != key >> 6) {
      blocks_.push_back({key >> 6, 0, static_cast<std::uint32_t>(cells_.size())});
    }
    blocks_.back().mask |= std::uint64_t{1} << (key & 63);
    cells_.push_back(static_cast<std::uint32_t>(i));
  }
  cells_.push_back(static_cast<std::uint32_t>(keys.size()));
}

namespace {
std::size_t hash_of(std::uint64_t key) {
  key *= 0x9e3779b97f4a7c15u;
  return static_cast<std::size_t>(key ^ (key >> 31));
}
}  // namespace

void GridNearest::Impl::build_table() {
  table_.assign(std::bit_ceil(2 * blocks_.size() + 2), Slot{});
  const std::size_t mask = table_.size() - 1;
  for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
    std::size_t i = hash_of(blocks_[b].key) & mask;
    while (table_[i].key != kFree) i = (i + 1) & mask;
    table_[i] = {blocks_[b].key, b};
  }
}

void GridNearest::Impl::build_octree() {
  levels_.clear();
  const auto join = [](const auto& below) {
    std::vector<Node> nodes;
    for (std::uint32_t i = 0; i < below.size(); ++i) {
      if (nodes.empty() || nodes.back().key != below[i].key >> 3) nodes.push_back({below[i].key >> 3, i});
    }
    return nodes;
  };
  levels_.push_back(join(blocks_));
  while (levels_.back().size() > 1) levels_.push_back(join(levels_.back()));
}

const GridNearest::Impl::Block* GridNearest::Impl::find(std::uint64_t key) const {
  const std::size_t mask = table_.size() - 1;
  for (std::size_t i = hash_of(key) & mask; table_[i].key != kFree; i = (i + 1) & mask) {
    if (table_[i].key == key) return &blocks_[table_[i].block];
  }
  return nullptr;
}

void GridNearest::Impl::scan(std::size_t cell, const Query& q, Best& best) const {
  for (std::uint32_t i = cells_[cell]; i < cells_[cell + 1]; ++i) {
    const double s = squared_distance(q.at, sorted[i]);
    if (s < best.squared) best = {s, i};
  }
}

/// The cells of a block that are in `part`.
void GridNearest::Impl::scan_part(const Block& block, std::uint64_t part, const Query& q, Best& best) const {
  for (std::uint64_t m = block.mask & part; m != 0; m &= m - 1) {
    const std::uint64_t bit = m & (0 - m);
    scan(block.first + count_bits(block.mask & (bit - 1)), q, best);
  }
}

/// Looks at all cells that may hold a nearer point than the best; false if they are too many for that.
bool GridNearest::Impl::look_around(const Query& q, Best& best) const {
  const VoxelCoord own{static_cast<std::uint32_t>(q.cell[0]), static_cast<std::uint32_t>(q.cell[1]),
                       static_cast<std::uint32_t>(q.cell[2])};
  const std::uint64_t own_key = morton_encode(own);
  const Block* const home = find(own_key >> 6);
  const std::uint64_t own_bit = std::uint64_t{1} << (own_key & 63);
  if (home != nullptr) scan_part(*home, own_bit, q, best);
  const double reach = std::sqrt(best.squared) * per_side_ + kSlack;
  if (!(reach < kFarthest)) return false;
  VoxelCoord low, high;
  for (std::size_t d = 0; d < 3; ++d) {
    low[d] = static_cast<std::uint32_t>(std::max(0.0, q.place[d] - reach));
    high[d] = static_cast<std::uint32_t>(std::min(kMostCell, q.place[d] + reach));
  }
  const auto slab = [&](std::size_t d, std::uint32_t block) {
    return kSlabs[d][std::max(low[d], 4 * block) & 3][std::min(high[d], 4 * block + 3) & 3];
  };
  for (std::uint32_t z = low[2] / 4; z <= high[2] / 4; ++z) {
    for (std::uint32_t y = low[1] / 4; y <= high[1] / 4; ++y) {
      const std::uint64_t row = slab(2, z) & slab(1, y);
      for (std::uint32_t x = low[0] / 4; x <= high[0] / 4; ++x) {
        const std::uint64_t key = morton_encode(VoxelCoord{x, y, z});
        const bool at_home = key == own_key >> 6;
        const Block* const block = at_home ? home : find(key);
        if (block != nullptr) scan_part(*block, row & slab(0, x) & ~(at_home ? own_bit : 0), q, best);
      }
    }
  }
  return true;
}

double GridNearest::Impl::squared_to(std::uint64_t key, int level, const Query& q) const {
  const VoxelCoord c = morton_decode(key);
  const double width = double(std::uint64_t{1} << level);
  double sum = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    const double low = double(c[d]) * width;
    const double off = std::max({0.0, low - q.place[d] - kSlack, q.place[d] - low - width - kSlack}) * side_;
    sum += off * off;
  }
  return sum;
}

void GridNearest::Impl::descend(std::size_t level, std::uint32_t begin, std::uint32_t end, const Query& q,
                                Best& best) const {
  // level 0: blocks; level l: nodes of levels_[l - 1]. Nearest first.
  std::array<std::pair<double, std::uint32_t>, 8> by_distance;
  std::size_t n = 0;
  for (std::uint32_t i = begin; i < end && n < by_distance.size(); ++i) {
    const std::uint64_t key = level == 0 ? blocks_[i].key : levels_[level - 1][i].key;
    by_distance[n++] = {squared_to(key, static_cast<int>(level) + 2, q), i};
  }
  std::sort(by_distance.begin(), by_distance.begin() + static_cast<std::ptrdiff_t>(n));
  for (std::size_t k = 0; k < n; ++k) {
    const auto [squared, i] = by_distance[k];
    if (squared >= best.squared) return;
    if (level == 0) {
      scan_part(blocks_[i], ~std::uint64_t{0}, q, best);
    } else {
      const std::vector<Node>& nodes = levels_[level - 1];
      const std::size_t below = level == 1 ? blocks_.size() : levels_[level - 2].size();
      descend(level - 1, nodes[i].first,
              i + 1 < nodes.size() ? nodes[i + 1].first : static_cast<std::uint32_t>(below), q, best);
    }
  }
}

Best GridNearest::Impl::search(const Vec3& query, std::uint32_t hint) const {
  Best best{squared_distance(query, sorted[hint]), hint};
  if (tree != nullptr) {
    best.at = tree->nearest(query, best.squared);
    return best;
  }
  Query q{query, {}, {}};
  bool inside = true;
  for (std::size_t d = 0; d < 3; ++d) {
    q.place[d] = (query[d] - corner_[d]) * per_side_;
    inside = inside && q.place[d] >= 0 && q.place[d] < kMostCell;
    q.cell[d] = inside ? static_cast<std::int64_t>(q.place[d]) : 0;
  }
  if (inside && look_around(q, best)) return best;
  descend(levels_.size(), 0, 1, q, best);
  return best;
}

GridNearest::GridNearest(std::span<const Vec3> points) : impl_(std::make_unique<Impl>(points)) {}
GridNearest::~GridNearest() = default;
GridNearest::GridNearest(GridNearest&&) noexcept = default;
GridNearest& GridNearest::operator=(GridNearest&&) noexcept = default;

std::span<const std::uint32_t> GridNearest::order() const {
  return impl_->ids;
}

Nearest GridNearest::find(std::span<const Vec3> from, std::span<const std::uint32_t> order) const {
  Nearest r{std::vector<std::uint32_t>(from.size()), std::vector<double>(from.size())};
  std::uint32_t hint = 0;
  for (const std::uint32_t i : order) {
    // The last answer is a good first guess.
    const Best best = impl_->search(from[i], hint);
    r.index[i] = impl_->ids[best.at];
    r.squared[i] = best.squared;
    hint = best.at;
  }
  return r;
}

double GridNearest::mean_squared(std::span<const Vec3> from, std::span<const std::uint32_t> order,
                                 std::size_t every) const {
  double sum = 0, count = 0;
  std::uint32_t hint = 0;
  for (std::size_t k = every / 2; k < order.size(); k += every, ++count) {
    const Best best = impl_->search(from[order[k]], hint);
    sum += best.squared;
    hint = best.at;
  }
  return count > 0 ? sum / count : 0;
}

RoughErrors estimate_errors(std::span<const Vec3> a, std::span<const Vec3> b) {
  // An eighth of many points is enough, all of few are soon asked.
  const auto every = [](std::size_t n) { return std::clamp<std::size_t>(n / 8000, 1, 8); };
  const GridNearest in_a(a), in_b(b);
  return {in_b.mean_squared(a, in_a.order(), every(a.size())),
          in_a.mean_squared(b, in_b.order(), every(b.size()))};
}

NearestPair find_nearest_pair(std::span<const Vec3> a, std::span<const Vec3> b) {
  const GridNearest in_a(a), in_b(b);
  return {in_b.find(a, in_a.order()), in_a.find(b, in_b.order())};
}

}  // namespace mapcodec
