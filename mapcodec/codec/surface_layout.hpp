// SPDX-License-Identifier: GPL-3.0-or-later
// What encoder and decoder of `surface` share besides the tree: the fields before it, where points lie, and
// the order that channels follow (FORMAT.md 10.1, 10.6).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/surface_points.hpp"
#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec::surface {

inline constexpr std::uint8_t kNoVoxels = 255;  ///< in place of a voxel shift: points stay in tree order
inline constexpr std::uint8_t kExactCounts = 31;
inline constexpr std::uint8_t kBlockBits =
    6;  ///< log2 of the voxels in blocks that the encoder uses [units]: two steps
inline constexpr int kSubUnitsPerStep = kStepUnits << kSubUnitBits;
inline constexpr int kVoxelBits = 20;  ///< log2 of the most voxels across a root cell
inline constexpr std::int64_t kMostBase = std::int64_t{1} << 47;
inline constexpr std::uint32_t kMostExtent = 1u << (kLongestSide - 5);  ///< a root cell's side [steps]

struct Header {
  std::uint8_t voxel_shift = kNoVoxels;  ///< log2 of a voxel's side [sub-units]
  std::array<std::int64_t, 3> base{0, 0,
                                   0};  ///< lowest corner of the root cell [units from the map's origin]
  bool fitted = false;                  ///< false in older tiles, which have neither of the next two
  std::array<std::uint32_t, 3> extent{1, 1, 1};  ///< of the points from the base [steps]
  std::uint8_t borders = 0;                      ///< see Outline
  std::uint8_t depth = 0;                        ///< the root cell has 2^depth units a side
  std::uint8_t count_shift = kExactCounts;
  std::uint8_t block_bits = 0;  ///< log2 of the side of voxels in blocks [units]; 0: there are no blocks
};

/// Smallest voxel shift for a root cell of 2^depth units.
[[nodiscard]] constexpr std::uint8_t least_voxel_shift(unsigned depth) {
  const int over = static_cast<int>(depth) + kSubUnitBits - kVoxelBits;
  return static_cast<std::uint8_t>(over > 0 ? over : 0);
}
/// Largest one: all in one voxel.
[[nodiscard]] constexpr std::uint8_t most_voxel_shift(unsigned depth) {
  return static_cast<std::uint8_t>(depth + kSubUnitBits);
}

[[nodiscard]] Outline outline_of(const Header& header);

void write_header(ByteWriter& out, const Header& header);
/// Errors: Truncated, Malformed.
[[nodiscard]] Result<Header> read_header(ByteReader& in);

/// Points of all leaves as spread_leaves gives them, kept inside the root cell or near it; none if they are
/// not `count`.
/// @param leaves  as a walk gives them: those of blocks are settled here. @param blocks, joints  of the walk.
[[nodiscard]] std::vector<SubUnits> points_of(std::vector<Leaf>& leaves, std::span<const Block> blocks,
                                              std::size_t count, const Header& header,
                                              std::span<const Joint> joints);

/// Where sub-units lie [m, map frame]. @param lattice  its step is the surface step.
[[nodiscard]] std::vector<Vec3> positions(const std::vector<SubUnits>& points,
                                          const std::array<std::int64_t, 3>& base, const Quantizer& lattice);

/// Points in Morton order of their voxels (stable), and the voxels in that order; points beside the root cell
/// belong to the nearest one.
struct VoxelOrder {
  std::vector<std::uint32_t> order;
  std::vector<VoxelCoord> voxels;
};
[[nodiscard]] VoxelOrder order_by_voxels(const std::vector<SubUnits>& points, unsigned depth,
                                         std::uint8_t voxel_shift);

}  // namespace mapcodec::surface
