// SPDX-License-Identifier: GPL-3.0-or-later
// How far a place is from the nearest original point, roughly and fast. Encoder only.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mapcodec/codec/surface_moments.hpp"

namespace mapcodec::surface {

/// A pyramid of occupied cells; the finest has half a surface step a side.
class Coverage {
 public:
  /// @param points  Morton-sorted. @param depth  log2 of the root cell's side.
  Coverage(std::span<const Units> points, unsigned depth);
  /// Squared distance [units^2] from a place [units] to the nearest point, within about a cell's side; 0 if
  /// it is less than `covered` [units^2].
  [[nodiscard]] double squared_distance(const std::array<double, 3>& place, double covered);

 private:
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};
  /// Four cells a side, one bit each.
  struct Block {
    std::uint64_t key = kFree;
    std::uint64_t cells = 0;
  };
  struct Level {
    unsigned side;  ///< of a cell, log2 [units]
    std::vector<Block> table;
    [[nodiscard]] std::uint64_t cells_of(std::uint64_t key) const;
  };
  void add_level(std::span<const Units> points, unsigned side);
  [[nodiscard]] double search(const std::array<std::int64_t, 3>& place, std::size_t first) const;

  /// Answers found before, since the candidates of nested cells ask for the same places again.
  struct Known {
    std::uint64_t key = kFree;
    float squared = 0;
  };
  static constexpr std::size_t kKnown = std::size_t{1} << 14;
  std::vector<Known> known_ = std::vector<Known>(kKnown);
  std::vector<Level> levels_;
};

}  // namespace mapcodec::surface
