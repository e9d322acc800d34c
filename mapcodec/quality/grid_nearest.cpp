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

constexpr int kMostBits = 20;              // cells across the finest grid, log2
constexpr int kUsualBits = 3;              // more of them than points need
constexpr std::size_t kPointsPerCell = 8;  // aimed at
constexpr double kCrowded = 64;            // mean over the points of how many may share their cell
constexpr double kTooCrowded = 256;        // where even the finest grid's are so many, a k-d tree is faster
constexpr double kSlack = 1e-7;            // of a cell: more than rounding can move a point
constexpr double kFarthest = 1.2;          // cells that are looked at one by one
constexpr int kCoarser = 3;                // halvings from one grid to the next

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

/// Mean over the points of how many share their cell, if the keys' last bits are left out.
double crowd_of(std::span<const std::uint64_t> keys, int shift) {
  double sum = 0;
  for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
    while (end < keys.size() && ((keys[end] ^ keys[begin]) >> (3 * shift)) == 0) ++end;
    sum += double(end - begin) * double(end - begin);
  }
  return sum / double(keys.size());
}

/// By how many halvings the finest cells should be coarser than the keys': the coarsest with not many points
/// each on average, or finer ones where most points are in a few of these.
int finest_cells(std::span<const std::uint64_t> keys, int bits) {
  std::array<std::size_t, kMostBits + 2> parts{};
  for (std::size_t i = 1; i < keys.size(); ++i) {
    ++parts[static_cast<std::size_t>((std::bit_width(keys[i] ^ keys[i - 1]) + 2) / 3)];
  }
  std::size_t cells = keys.size() - parts[0];
  int shift = 0;
  while (shift < bits &&
         (cells - parts[static_cast<std::size_t>(shift) + 1]) * kPointsPerCell >= keys.size()) {
    cells -= parts[static_cast<std::size_t>(++shift)];
  }
  while (shift > 0 && crowd_of(keys, shift) > kCrowded) --shift;
  return shift;
}

std::size_t hash_of(std::uint64_t key) {
  key *= 0x9e3779b97f4a7c15u;
  return static_cast<std::size_t>(key ^ (key >> 31));
}

/// A query in the terms of the keys' cells.
struct Query {
  Vec3 at;
  std::array<double, 3> place;
};

/// Points in the cells of one size: blocks of 4 x 4 x 4 in a hash table, each with a mask of the cells that
/// hold points.
class Grid {
 public:
  /// @param sorted  the points in the keys' order; must outlive this.
  Grid(std::span<const Vec3> sorted, std::span<const std::uint64_t> keys, int bits, int shift)
      : sorted_(sorted), per_side_(1 / double(1 << shift)), most_(double((1 << bits) >> shift) - 1) {
    build_cells(keys, shift);
    build_table();
  }
  [[nodiscard]] std::size_t blocks() const { return blocks_.size(); }

  /// Looks at all cells that may hold a nearer point than the best; false if they are too many for that, and
  /// then only at the query's own. @param per_cell  of the keys' cells in a metre.
  [[nodiscard]] bool look_around(const Query& q, double per_cell, bool last, Best& best) const;

 private:
  struct Block {
    std::uint64_t key, mask;
    std::uint32_t first;  ///< cell
  };
  struct Slot {
    std::uint64_t key = kFree;
    std::uint32_t block = 0;
  };
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};

  void build_cells(std::span<const std::uint64_t> keys, int shift);
  void build_table();
  [[nodiscard]] const Block* find(std::uint64_t key) const;
  void scan(std::size_t cell, const Vec3& at, Best& best) const;
  void scan_part(const Block& block, std::uint64_t part, const Vec3& at, Best& best) const;
  [[nodiscard]] std::uint32_t cell_at(double place) const {
    return static_cast<std::uint32_t>(std::clamp(place, 0.0, most_));
  }

  std::span<const Vec3> sorted_;
  double per_side_;                   ///< of the keys' cells
  double most_;                       ///< coordinate of a cell
  std::vector<std::uint32_t> cells_;  ///< first point of each, and the end
  std::vector<Block> blocks_;
  std::vector<Slot> table_;
};

void Grid::build_cells(std::span<const std::uint64_t> keys, int shift) {
  std::uint64_t last = ~std::uint64_t{0};
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::uint64_t key = keys[i] >> (3 * shift);
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

void Grid::build_table() {
  table_.assign(std::bit_ceil(2 * blocks_.size() + 2), Slot{});
  const std::size_t mask = table_.size() - 1;
  for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
    std::size_t i = hash_of(blocks_[b].key) & mask;
    while (table_[i].key != kFree) i = (i + 1) & mask;
    table_[i] = {blocks_[b].key, b};
  }
}

const Grid::Block* Grid::find(std::uint64_t key) const {
  const std::size_t mask = table_.size() - 1;
  for (std::size_t i = hash_of(key) & mask; table_[i].key != kFree; i = (i + 1) & mask) {
    if (table_[i].key == key) return &blocks_[table_[i].block];
  }
  return nullptr;
}

void Grid::scan(std::size_t cell, const Vec3& at, Best& best) const {
  // Selections, not branches: which point is nearer cannot be foreseen.
  Best b = best;
  for (std::uint32_t i = cells_[cell]; i < cells_[cell + 1]; ++i) {
    const double s = squared_distance(at, sorted_[i]);
    const bool nearer = s < b.squared;
    b.at = nearer ? i : b.at;
    b.squared = nearer ? s : b.squared;
  }
  best = b;
}

/// The cells of a block that are in `part`.
void Grid::scan_part(const Block& block, std::uint64_t part, const Vec3& at, Best& best) const {
  for (std::uint64_t m = block.mask & part; m != 0; m &= m - 1) {
    const std::uint64_t bit = m & (0 - m);
    scan(block.first + count_bits(block.mask & (bit - 1)), at, best);
  }
}

bool Grid::look_around(const Query& q, double per_cell, bool last, Best& best) const {
  const VoxelCoord own{cell_at(q.place[0] * per_side_), cell_at(q.place[1] * per_side_),
                       cell_at(q.place[2] * per_side_)};
  const std::uint64_t own_key = morton_encode(own);
  const Block* const home = find(own_key >> 6);
  const std::uint64_t own_bit = std::uint64_t{1} << (own_key & 63);
  if (home != nullptr) scan_part(*home, own_bit, q.at, best);
  const double reach = std::sqrt(best.squared) * per_cell * per_side_ + kSlack;
  if (!last && !(reach < kFarthest)) return false;
  VoxelCoord low, high;
  for (std::size_t d = 0; d < 3; ++d) {
    low[d] = cell_at(q.place[d] * per_side_ - reach);
    high[d] = cell_at(q.place[d] * per_side_ + reach);
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
        if (block != nullptr) scan_part(*block, row & slab(0, x) & ~(at_home ? own_bit : 0), q.at, best);
      }
    }
  }
  return true;
}

}  // namespace

/// Grids from fine to coarse, the last of one block.
struct GridNearest::Impl {
  explicit Impl(std::span<const Vec3> points);

  [[nodiscard]] Best search(const Vec3& query, std::uint32_t hint) const;

  std::vector<std::uint32_t> order;     ///< all points
  std::vector<Vec3> sorted;             ///< those that differ from the one before them
  std::vector<std::uint32_t> ids;       ///< theirs
  std::unique_ptr<NeighborIndex> tree;  ///< instead of all below, where too many points share a cell

 private:
  [[nodiscard]] bool place(std::span<const Vec3> points, int bits);

  Vec3 corner_{};
  double per_side_ = 1;  ///< of the keys' cells
  std::vector<Grid> grids_;
};

GridNearest::Impl::Impl(std::span<const Vec3> points) {
  const int bits =
      std::clamp((static_cast<int>(std::bit_width(points.size())) + 1) / 2 + kUsualBits, 4, kMostBits);
  if (!place(points, bits) && !place(points, kMostBits)) tree = std::make_unique<NeighborIndex>(sorted);
}

/// False if many points share cells even of a 2^-bits of the extent: equal ones, or a few far away.
bool GridNearest::Impl::place(std::span<const Vec3> points, int bits) {
  Box box;
  for (const Vec3& p : points) box.add(p);
  double extent = 0;
  for (std::size_t d = 0; d < 3; ++d) extent = std::max(extent, box.max[d] - box.min[d]);
  corner_ = box.min;
  per_side_ = extent > 0 && std::isnormal(extent) ? double(1 << bits) / extent : 1;
  const double most = double(1 << bits) - 1;
  std::vector<KeyedIndex> keys(points.size()), scratch;
  for (std::size_t i = 0; i < points.size(); ++i) {
    VoxelCoord c;
    for (std::size_t d = 0; d < 3; ++d) {
      c[d] = static_cast<std::uint32_t>(std::min(most, (points[i][d] - corner_[d]) * per_side_));
    }
    keys[i] = {morton_encode(c), static_cast<std::uint32_t>(i)};
  }
  radix_sort(keys, scratch, 3 * bits);
  order.clear();
  ids.clear();
  sorted.clear();
  order.reserve(points.size());
  ids.reserve(points.size());
  sorted.reserve(points.size());
  std::vector<std::uint64_t> cells;
  cells.reserve(points.size());
  for (const KeyedIndex& k : keys) {
    order.push_back(k.index);
    // A scanner's missing returns are often many points at one place.
    if (!cells.empty() && cells.back() == k.key && sorted.back() == points[k.index]) continue;
    cells.push_back(k.key);
    ids.push_back(k.index);
    sorted.push_back(points[k.index]);
  }
  int shift = finest_cells(cells, bits);
  if (shift == 0 && crowd_of(cells, 0) > kTooCrowded) return false;
  for (;; shift = std::min(shift + kCoarser, bits)) {
    grids_.emplace_back(sorted, cells, bits, shift);
    if (grids_.back().blocks() == 1) return true;
  }
}

Best GridNearest::Impl::search(const Vec3& query, std::uint32_t hint) const {
  Best best{squared_distance(query, sorted[hint]), hint};
  if (tree != nullptr) {
    best.at = tree->nearest(query, best.squared);
    return best;
  }
  Query q{query, {}};
  for (std::size_t d = 0; d < 3; ++d) q.place[d] = (query[d] - corner_[d]) * per_side_;
  for (const Grid& grid : grids_) {
    if (grid.look_around(q, per_side_, &grid == &grids_.back(), best)) break;
  }
  return best;
}

GridNearest::GridNearest(std::span<const Vec3> points) : impl_(std::make_unique<Impl>(points)) {}
GridNearest::~GridNearest() = default;
GridNearest::GridNearest(GridNearest&&) noexcept = default;
GridNearest& GridNearest::operator=(GridNearest&&) noexcept = default;

std::span<const std::uint32_t> GridNearest::order() const {
  return impl_->order;
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
