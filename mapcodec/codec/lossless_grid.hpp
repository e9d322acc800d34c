// SPDX-License-Identifier: GPL-3.0-or-later
// The numbers that one axis of a lossless tile can hold, cut into cells (FORMAT.md 5.1).
#pragma once

#include <bit>

#include "mapcodec/attribute/value_lattice.hpp"
#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// Where a number lies: in which cell, and which of the numbers in it.
struct GridValue {
  std::int64_t cell = 0;
  std::uint64_t rest = 0;  ///< offset from the cell's first number (towards larger magnitude for floats)
  int rest_bits = 0;       ///< the cell holds 2^rest_bits numbers
  std::uint32_t depth =
      0;  ///< floats in a cell that touches zero: binades below the cell's outer end, 1 or more
};

/// Floats: cell j >= 0 holds [j, j + 1) 2^exponent, cell -1 - j the negative numbers of those magnitudes, so
/// -0 lies in cell -1. A cell away from zero lies within one binade, so its numbers are counted by whole
/// bits. Lattices: cell k >> exponent (k << -exponent if negative).
struct AxisGrid {
  enum class Kind : std::uint8_t { f32 = 0, f64 = 1, lattice = 2 };
  Kind kind = Kind::f32;
  ValueLattice lattice;
  int exponent = 0;

  static constexpr int kLeast = -64;
  static constexpr std::int64_t kMostCell = std::int64_t{1} << 53;
  [[nodiscard]] int most() const { return kind == Kind::f32 ? 110 : kind == Kind::f64 ? 1010 : 60; }
  [[nodiscard]] int mantissa() const { return kind == Kind::f32 ? 23 : 52; }

  /// `x` must be one of the grid's numbers, and its cell below kMostCell.
  [[nodiscard]] GridValue split(double x) const {
    return kind == Kind::lattice ? split_lattice(x) : split_float(x);
  }

  /// How many bits `rest` of a cell has. Cells 0 and -1 of floats: those of the mantissa.
  [[nodiscard]] int rest_bits(std::int64_t cell) const {
    if (kind == Kind::lattice) return exponent > 0 ? exponent : 0;
    const std::int64_t j = cell < 0 ? -1 - cell : cell;
    return j == 0 ? mantissa()
                  : std::max(
                        0, mantissa() + 1 - static_cast<int>(std::bit_width(static_cast<std::uint64_t>(j))));
  }
  [[nodiscard]] bool touches_zero(std::int64_t cell) const {
    return kind != Kind::lattice && (cell == 0 || cell == -1);
  }
  /// Largest `depth` in a cell that touches zero.
  [[nodiscard]] std::uint32_t most_depth() const {
    return static_cast<std::uint32_t>(exponent + (kind == Kind::f32 ? 127 : 1023));
  }

  /// Undoes split: finite unless the cell is none of an honest encoder's.
  [[nodiscard]] double join(const GridValue& v) const;

 private:
  [[nodiscard]] GridValue split_lattice(double x) const;
  [[nodiscard]] GridValue split_float(double x) const;
  [[nodiscard]] std::uint64_t magnitude_bits(double x) const;
  [[nodiscard]] double from_magnitude(std::uint64_t bits, bool negative) const;
};

void write_grid(ByteWriter& out, const AxisGrid& grid);
/// @param axis  which scale and offset of `format` a fixed lattice takes.
/// Errors: Truncated, Malformed.
[[nodiscard]] Result<AxisGrid> read_grid(ByteReader& in, const CoordinateFormat& format, std::size_t axis);

}  // namespace mapcodec
