// SPDX-License-Identifier: GPL-3.0-or-later
// How the components of a channel are turned into small integers and predicted: the head of a "values"
// section.
#pragma once

#include <vector>

#include "mapcodec/attribute/value_lattice.hpp"
#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/cloud/channel.hpp"

namespace mapcodec {

/// Written to archives.
enum class Predictor : std::uint8_t {
  none = 0,       ///< plain bits, as many as the largest integer has
  previous = 1,   ///< the point before
  neighbors = 2,  ///< weighted mean of the nearest points coded before
  category = 3,   ///< equal to one of the nearest points, or named; for integers below 256
};

/// One component. A value's key is its ordered_bits, or on a lattice k + 2^63; the coded integer is
/// u = (key - base) / divisor (rounded to nearest where a bound allows it), or its rank in the palette.
struct ComponentPlan {
  bool on_lattice = false;
  ValueLattice lattice;
  bool escapes = false;  ///< lattice only: some values are not on it, and stand in full beside it
  std::uint64_t base = 0;
  std::uint64_t divisor = 1;
  std::uint64_t most = 0;              ///< largest u
  std::vector<std::uint64_t> palette;  ///< ascending values of u; empty: none
  Predictor predictor = Predictor::neighbors;
  /// Sixteenths of the deviations of the components before this one that are added to the prediction.
  std::array<std::int8_t, 3> cross{};

  /// Largest coded integer.
  [[nodiscard]] std::uint64_t most_coded() const { return palette.empty() ? most : palette.size() - 1; }
};

inline constexpr std::uint64_t kLatticeKeyBias = std::uint64_t{1} << 63;
inline constexpr std::size_t kMostPalette = 4096;
/// Wider integers are predicted without cross terms and averaging of far values, so that nothing overflows.
inline constexpr std::uint64_t kNarrow = std::uint64_t{1} << 32;

/// Components are coded in this order: green first for colours, since it predicts the others best.
[[nodiscard]] inline std::size_t component_at(const ChannelInfo& info, std::size_t rank) {
  const bool color = info.components == 3 && info.name == "rgb";
  return color && rank < 2 ? 1 - rank : rank;
}

void write_plan(ByteWriter& out, const ComponentPlan& plan);
/// Errors: Truncated, Malformed.
[[nodiscard]] Result<ComponentPlan> read_plan(ByteReader& in, ScalarType scalar);

}  // namespace mapcodec
