// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/tile_plan.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <string>

namespace mapcodec {
namespace {

using Cell = VoxelHistogram::Cell;

constexpr double kSplitAbove = 1.5;
constexpr double kMaxTileNumber = 2147483647.0;

/// A cube of the octree under construction: its cells stand side by side. Side = cell << level.
struct Node {
  std::size_t begin = 0, end = 0;
  int level = 0;
};

CellIndex first_cell(const std::vector<Cell>& cells) {
  CellIndex lo = cells.front().index;
  for (const Cell& c : cells) {
    lo = {std::min(lo.x, c.index.x), std::min(lo.y, c.index.y), std::min(lo.z, c.index.z)};
  }
  return lo;
}

/// Level of the smallest cube at corner zero that holds all cells.
int root_level(const std::vector<Cell>& cells) {
  std::uint32_t all = 0;
  for (const Cell& c : cells)
    all |= std::uint32_t(c.index.x) | std::uint32_t(c.index.y) | std::uint32_t(c.index.z);
  return std::bit_width(all);
}

std::uint64_t points_in(const std::vector<Cell>& cells, const Node& n) {
  std::uint64_t sum = 0;
  for (std::size_t i = n.begin; i < n.end; ++i) sum += cells[i].points;
  return sum;
}

std::size_t octant(const CellIndex& c, int bit) {
  return std::size_t((c.x >> bit) & 1) | std::size_t((c.y >> bit) & 1) << 1 |
         std::size_t((c.z >> bit) & 1) << 2;
}

/// Sorts the cells of `n` by octant and appends its occupied children to `nodes`.
void split(std::vector<Cell>& cells, const Node& n, std::vector<Node>& nodes) {
  std::array<std::vector<Cell>, 8> parts;
  for (std::size_t i = n.begin; i < n.end; ++i)
    parts[octant(cells[i].index, n.level - 1)].push_back(cells[i]);
  std::size_t at = n.begin;
  for (const std::vector<Cell>& part : parts) {
    if (part.empty()) continue;
    std::copy(part.begin(), part.end(), cells.begin() + static_cast<std::ptrdiff_t>(at));
    nodes.push_back({at, at + part.size(), n.level - 1});
    at += part.size();
  }
}

struct Cube {
  Node node;
  CellIndex corner;  ///< any cell of it
  std::uint64_t points = 0;
};

/// The leaves. Levels count from the histogram's cell.
std::vector<Cube> split_all(std::vector<Cell> cells, double target_points, int max_level) {
  std::vector<Cube> leaves;
  std::vector<Node> nodes{{0, cells.size(), root_level(cells)}};
  while (!nodes.empty()) {
    const Node n = nodes.back();
    nodes.pop_back();
    const std::uint64_t points = points_in(cells, n);
    const bool full = static_cast<double>(points) > target_points * kSplitAbove;
    if (n.level > 0 && (full || n.level > max_level)) {
      split(cells, n, nodes);
    } else {
      leaves.push_back({n, cells[n.begin].index, points});
    }
  }
  return leaves;
}

Error bad_size(const std::string& why) {
  return make_error(ErrorCode::kInvalidArgument, "tile size " + why);
}

Status check_uniform(double side, const Box& bounds, double max_side_m) {
  if (!(side > 0) || !std::isfinite(side)) return bad_size("must be a positive number of metres");
  if (side > max_side_m)
    return bad_size("must not exceed " + std::to_string(max_side_m) + " m at this precision");
  for (std::size_t d = 0; d < 3 && !bounds.empty(); ++d) {
    if ((bounds.max[d] - bounds.min[d]) / side + 2 > kMaxTileNumber)
      return bad_size("is too small for a map this large");
  }
  return {};
}

std::vector<std::uint8_t> levels_by_points(const std::vector<TileLeaf>& leaves) {
  std::array<std::uint64_t, 256> points{};
  std::vector<std::uint8_t> levels;
  for (const TileLeaf& l : leaves) {
    if (points[l.key.level] == 0) levels.push_back(l.key.level);
    points[l.key.level] += l.points;
  }
  std::sort(levels.begin(), levels.end(), [&](std::uint8_t a, std::uint8_t b) {
    return points[a] != points[b] ? points[a] > points[b] : a < b;
  });
  return levels;
}

/// log2 of the largest power of two that is not larger than `side`, beyond any octree for infinity.
int log2_at_most(double side) {
  return std::isfinite(side) ? std::ilogb(side) : 1024;
}

}  // namespace

void TilePlan::cover(const Survey& survey, const TilePlanSettings& settings) {
  std::vector<Cell> cells = survey.histogram.cells();
  for (Cell& c : cells) {
    c.index = {c.index.x - first_cell_.x, c.index.y - first_cell_.y, c.index.z - first_cell_.z};
  }
  const int max_level = log2_at_most(settings.max_side_m) - survey.histogram.exponent();
  const std::vector<Cube> cubes = split_all(std::move(cells), settings.target_points, max_level);
  cell_shift_ = 31;
  for (const Cube& c : cubes) cell_shift_ = std::min(cell_shift_, c.node.level);
  for (const Cube& c : cubes) {
    const int shift = c.node.level;
    const auto level = static_cast<std::uint8_t>(shift - cell_shift_);
    leaves_.push_back({{c.corner.x >> shift, c.corner.y >> shift, c.corner.z >> shift, level}, c.points});
  }
  std::sort(leaves_.begin(), leaves_.end(),
            [](const TileLeaf& a, const TileLeaf& b) { return compare_morton(a.key, b.key) < 0; });
  for (const TileLeaf& l : leaves_) index_.add(l.key);
  levels_ = levels_by_points(leaves_);
  tile_size_m_ = std::ldexp(survey.histogram.cell_m(), cell_shift_);
  uniform_ = false;
}

Result<TilePlan> plan_tiles(const Survey& survey, const TilePlanSettings& settings) {
  if (!(settings.target_points > 0) || !(settings.max_side_m > 0)) return bad_size("limits must be positive");
  if (settings.tile_size_m)
    MAPCODEC_TRY(check_uniform(*settings.tile_size_m, survey.bounds, settings.max_side_m));
  TilePlan plan;
  plan.points_ = survey.points;
  plan.tile_size_m_ = settings.tile_size_m.value_or(1);
  const std::vector<Cell> cells = survey.histogram.cells();
  if (cells.empty()) return plan;
  const double cell_m = survey.histogram.cell_m();
  plan.lattice_origin_ = survey.histogram.origin();
  plan.cells_per_m_ = 1 / cell_m;
  plan.first_cell_ = first_cell(cells);
  const CellIndex& lo = plan.first_cell_;
  plan.origin_ = {plan.lattice_origin_[0] + lo.x * cell_m, plan.lattice_origin_[1] + lo.y * cell_m,
                  plan.lattice_origin_[2] + lo.z * cell_m};
  if (settings.tile_size_m) return plan;
  // Where the map is so wide that even its histogram's cells are larger than a tile may be, all tiles get
  // that side.
  if (cell_m > settings.max_side_m) {
    plan.tile_size_m_ = std::ldexp(1.0, log2_at_most(settings.max_side_m));
    MAPCODEC_TRY(check_uniform(plan.tile_size_m_, survey.bounds, settings.max_side_m));
    return plan;
  }
  plan.cover(survey, settings);
  return plan;
}

std::optional<CellIndex> TilePlan::uniform_cell(const Vec3& p) const {
  std::array<std::int32_t, 3> c{};
  for (std::size_t d = 0; d < 3; ++d) {
    const double v = (p[d] - origin_[d]) / tile_size_m_;
    if (!(std::abs(v) < kMaxTileNumber)) return std::nullopt;
    c[d] = floor_to_int(v);
  }
  return CellIndex{c[0], c[1], c[2]};
}

std::optional<CellIndex> TilePlan::octree_cell(const Vec3& p) const {
  constexpr double kRange = 1073741824.0;  // what a histogram holds
  const Vec3 v{(p[0] - lattice_origin_[0]) * cells_per_m_, (p[1] - lattice_origin_[1]) * cells_per_m_,
               (p[2] - lattice_origin_[2]) * cells_per_m_};
  const auto outside = [](double c) { return !(c >= -kRange && c < kRange); };
  if (outside(v[0]) || outside(v[1]) || outside(v[2])) return std::nullopt;
  // No overflow: all numbers are in [-2^30, 2^30), and what would be negative is in no tile.
  const std::int32_t x = floor_to_int(v[0]) - first_cell_.x, y = floor_to_int(v[1]) - first_cell_.y,
                     z = floor_to_int(v[2]) - first_cell_.z;
  if ((x | y | z) < 0) return std::nullopt;
  return CellIndex{x >> cell_shift_, y >> cell_shift_, z >> cell_shift_};
}

std::uint32_t TilePlan::find_leaf(const CellIndex& c) const {
  for (const std::uint8_t l : levels_) {
    const std::uint32_t found = index_.find({c.x >> l, c.y >> l, c.z >> l, l});
    if (found != KeyIndex::kNone) return found;
  }
  return KeyIndex::kNone;
}

std::optional<TileKey> TilePlan::tile_of(const Vec3& p) const {
  if (!has_place(p)) return TileKey::unplaced();
  const std::optional<CellIndex> cell = uniform_ ? uniform_cell(p) : octree_cell(p);
  if (!cell) return std::nullopt;
  if (uniform_) return TileKey{cell->x, cell->y, cell->z, 0};
  const std::uint32_t leaf = find_leaf(*cell);
  return leaf == KeyIndex::kNone ? std::nullopt : std::optional<TileKey>(leaves_[leaf].key);
}

TileLocator::TileLocator(const TilePlan& plan) : plan_(plan) {
  if (!plan.uniform_) index_ = plan.index_;
}

std::uint32_t TileLocator::locate(const Vec3& p) {
  if (!has_place(p)) return index_.add(TileKey::unplaced());
  const std::optional<CellIndex> cell = plan_.uniform_ ? plan_.uniform_cell(p) : plan_.octree_cell(p);
  return cell ? find(*cell) : KeyIndex::kNone;
}

std::uint32_t TileLocator::find(const CellIndex& c) {
  const std::uint32_t mix =
      std::uint32_t(c.x) * 0x9E3779B1u ^ std::uint32_t(c.y) * 0x85EBCA77u ^ std::uint32_t(c.z) * 0xC2B2AE3Du;
  Known& known = known_[mix >> 24];
  if (known.number == KeyIndex::kNone || !(known.cell == c)) {
    known = {c, plan_.uniform_ ? index_.add({c.x, c.y, c.z, 0}) : plan_.find_leaf(c)};
  }
  return known.number;
}

}  // namespace mapcodec
