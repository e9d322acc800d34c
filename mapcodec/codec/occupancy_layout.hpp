// SPDX-License-Identifier: GPL-3.0-or-later
// What stands before an occupancy tile's code (FORMAT.md 12.1), for encoder and decoder.
#pragma once

#include "mapcodec/cloud/occupancy_pieces.hpp"
#include "mapcodec/codec/occupancy_stream.hpp"

namespace mapcodec::occupancy {

/// First byte of the section.
struct Form {
  OccupancyKind kind = OccupancyKind::binary;  ///< bits 0, 1
  Cell root = Cell::inner;                     ///< bits 2, 3
  bool exceptions = false;                     ///< bit 4
  /// Bit 5, of every tree with log-odds. Without it they are in mixed bits, which only the first archives
  /// had.
  static constexpr unsigned kSymbols = 32;

  [[nodiscard]] std::uint8_t byte() const {
    return static_cast<std::uint8_t>(static_cast<unsigned>(kind) | static_cast<unsigned>(root) << 2 |
                                     (exceptions ? 16u : 0u) |
                                     (kind == OccupancyKind::binary ? 0u : kSymbols));
  }
  [[nodiscard]] static Form from(std::uint8_t b) {
    return {static_cast<OccupancyKind>(b & 3), static_cast<Cell>(b >> 2 & 3), (b & 16) != 0};
  }
};

/// Most entries of a value table; rarer values are escaped.
inline constexpr std::uint64_t kMostValues = 4096;

/// [m, map frame] of a leaf or tile, as OctoMap places it. @param side  in voxels.
[[nodiscard]] inline Vec3 center_of(const CellCorner& corner, double side, double resolution_m) {
  Vec3 v;
  for (std::size_t d = 0; d < 3; ++d) v[d] = (double(corner[d]) + side / 2 - 32768) * resolution_m;
  return v;
}

}  // namespace mapcodec::occupancy
