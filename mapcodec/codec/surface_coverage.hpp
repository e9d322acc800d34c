// SPDX-License-Identifier: GPL-3.0-or-later
// How far a place is from the nearest original point, roughly and fast. Encoder only.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mapcodec/codec/surface_moments.hpp"

namespace mapcodec::surface {

/// A pyramid of occupied cells; the finest has half a surface step a side. Levels are built when first asked
/// for, so a Coverage belongs to one thread.
class Coverage {
 public:
  /// @param points  Morton-sorted; must outlive this. @param depth  log2 of the root cell's side.
  Coverage(std::span<const Units> points, unsigned depth);
  /// Squared distance [units^2] from a place [units] to the nearest point, within about a cell's side; 0 if
  /// it is less than `covered` [units^2].
  [[nodiscard]] double squared_distance(const std::array<double, 3>& place, double covered) {
    return squared_distance(place, covered, first_level(covered));
  }
  /// Sum over several places, or over some of them that is more than `most`.
  [[nodiscard]] double sum_of_squared(std::span<const std::array<double, 3>> places, double covered,
                                      double most);

 private:
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};
  using Cell = std::array<std::int64_t, 3>;
  /// Four cells a side, one bit each.
  struct Block {
    std::uint64_t key = kFree;
    std::uint64_t cells = 0;
  };
  /// Blocks by their keys.
  class Table {
   public:
    void reserve(std::size_t blocks);
    [[nodiscard]] bool empty() const { return slots_.empty(); }
    void add(std::uint64_t key, std::uint64_t cells);
    [[nodiscard]] std::uint64_t cells_at(std::uint64_t key);

   private:
    [[nodiscard]] std::size_t slot(std::uint64_t key) const;
    std::vector<Block> slots_;
    std::size_t last_ = 0;  ///< where the last answer was found: the next is often the same
  };
  struct Level {
    unsigned side = 0;  ///< of a cell, log2 [units]
    Table held;         ///< cells that hold points
    Table near;         ///< that do, or touch one that does
    void build(std::span<const Units> points);
    /// Points to a block of cells, on average.
    [[nodiscard]] static bool is_sparse(std::span<const Units> points, unsigned side);

   private:
    void spread(const Block& from);
  };

  [[nodiscard]] std::size_t first_level(double covered) const;
  [[nodiscard]] Level& level(std::size_t l);
  [[nodiscard]] double squared_distance(const std::array<double, 3>& place, double covered,
                                        std::size_t first);
  [[nodiscard]] static bool is_near(Level& level, const Cell& place);
  [[nodiscard]] static double nearest_of_eight(Level& level, const Cell& place);

  std::span<const Units> points_;
  std::vector<Level> levels_;
};

}  // namespace mapcodec::surface
