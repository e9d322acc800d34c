// SPDX-License-Identifier: GPL-3.0-or-later
// Which cubes a map is cut into.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/tile_key.hpp"
#include "parallel/key_index.hpp"
#include "parallel/survey.hpp"

namespace mapcodec {

struct TilePlanSettings {
  std::optional<double>
      tile_size_m;                ///< given: all tiles are cubes of this side; otherwise chosen by density
  double target_points = 100000;  ///< chosen by density: points that a tile should hold
  /// No tile side may be larger [m]: 2^20 steps of a lattice codec.
  double max_side_m = std::numeric_limits<double>::infinity();
};

struct TileLeaf {
  TileKey key;
  std::uint64_t points = 0;  ///< by the survey
};

/// A partition of a surveyed map into cubes. Every surveyed point has exactly one tile.
///
/// By density, the tiles are the leaves of an octree over powers of two metres: a cube is split while it
/// holds more than 1.5 times the target (or is larger than max_side_m), down to the cells of the survey's
/// histogram. The octree's corner, the map's origin, is the corner of the histogram cell at bounds.min: near
/// the points, so that keys are small numbers and a map that lies around zero is not cut there; and a
/// multiple of a power of two metres, thus exact. Threads: const use from many.
class TilePlan {
 public:
  /// [m, map frame] minimum corner of tile (0, 0, 0).
  [[nodiscard]] const Vec3& origin() const { return origin_; }
  /// Side of level-0 tiles: the smallest used.
  [[nodiscard]] double tile_size_m() const { return tile_size_m_; }
  /// The tiles in Morton order. Empty if the caller gave the size: then the points decide which tiles there
  /// are.
  [[nodiscard]] const std::vector<TileLeaf>& leaves() const { return leaves_; }
  /// Points of the survey, placed or not.
  [[nodiscard]] std::uint64_t points() const { return points_; }
  /// The tile of `p`; TileKey::unplaced() without has_place(p); nothing for a point in no tile, which the
  /// survey did not see.
  [[nodiscard]] std::optional<TileKey> tile_of(const Vec3& p) const;

 private:
  friend class TileLocator;
  friend Result<TilePlan> plan_tiles(const Survey&, const TilePlanSettings&);

  [[nodiscard]] std::optional<CellIndex> uniform_cell(const Vec3& p) const;
  [[nodiscard]] std::optional<CellIndex> octree_cell(const Vec3& p) const;
  [[nodiscard]] std::uint32_t find_leaf(const CellIndex& cell) const;
  void cover(const Survey& survey, const TilePlanSettings& settings);

  Vec3 origin_{0, 0, 0};
  double tile_size_m_ = 1;
  std::uint64_t points_ = 0;
  std::vector<TileLeaf> leaves_;
  KeyIndex index_;                    // of leaves_, in their order
  std::vector<std::uint8_t> levels_;  // that occur, those of the most points first
  bool uniform_ = true;
  // The octree asks the histogram's own lattice, and integers from there on: rounding cannot part a point
  // from its cell.
  Vec3 lattice_origin_{0, 0, 0};
  double cells_per_m_ = 1;
  CellIndex first_cell_;  // of the histogram, at origin_
  int cell_shift_ = 0;    // tile_size_m_ = cell << cell_shift_
};

/// Errors: InvalidArgument: a size that is not positive and finite, larger than max_side_m, or so small that
/// tile numbers leave 32 bits.
[[nodiscard]] Result<TilePlan> plan_tiles(const Survey& survey, const TilePlanSettings& settings);

/// Finds the tiles of many points, fastest when neighbours come one after the other. One per thread.
class TileLocator {
 public:
  /// The plan must outlive it.
  explicit TileLocator(const TilePlan& plan);
  /// Number of the tile of `p` in `keys()`, or KeyIndex::kNone for a point in no tile.
  [[nodiscard]] std::uint32_t locate(const Vec3& p);
  /// What the numbers mean. Grows while points are located.
  [[nodiscard]] const std::vector<TileKey>& keys() const { return index_.keys(); }

 private:
  [[nodiscard]] std::uint32_t find(const CellIndex& cell);

  /// A level-0 cell that was asked for.
  struct Known {
    CellIndex cell;
    std::uint32_t number = KeyIndex::kNone;
  };
  const TilePlan& plan_;
  KeyIndex index_;  // by density: all leaves first
  std::array<Known, 256> known_;
};

}  // namespace mapcodec
