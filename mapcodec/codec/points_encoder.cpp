// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/points_encoder.hpp"

#include <bit>
#include <limits>

#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/octree_encoder.hpp"
#include "mapcodec/codec/points_layout.hpp"
#include "mapcodec/geometry/morton.hpp"
#include "mapcodec/geometry/radix_sort.hpp"

namespace mapcodec {
namespace {

/// The tile on the map's lattice.
struct Cells {
  std::vector<LatticeCoord> at;  ///< of each input point
  LatticeCoord base{};           ///< smallest on each axis
  std::uint32_t depth = 0;
};

Status check(std::span<const Vec3> xyz, const Quantizer& quantizer) {
  if (xyz.empty()) return make_error(ErrorCode::kEmpty, "no points to encode");
  if (!(quantizer.step_m > 0) || !std::isfinite(quantizer.step_m) || !is_finite(quantizer.origin)) {
    return make_error(ErrorCode::kInvalidArgument, "voxel step or origin is not a proper number");
  }
  if (xyz.size() > std::numeric_limits<std::uint32_t>::max() / 2) {
    return make_error(ErrorCode::kInvalidArgument, "too many points in one tile");
  }
  return {};
}

Result<Cells> to_lattice(std::span<const Vec3> xyz, const Quantizer& quantizer) {
  Cells cells;
  cells.at.resize(xyz.size());
  cells.base.fill(std::numeric_limits<std::int64_t>::max());
  LatticeCoord most;
  most.fill(std::numeric_limits<std::int64_t>::min());
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    if (!quantizer.accepts(xyz[i])) {
      return make_error(ErrorCode::kInvalidArgument,
                        "point " + std::to_string(i) + " is not finite or too far away");
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int64_t v = quantizer.lattice(xyz[i][axis], axis);
      cells.at[i][axis] = v;
      cells.base[axis] = std::min(cells.base[axis], v);
      most[axis] = std::max(most[axis], v);
    }
  }
  std::uint64_t extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    extent = std::max(extent, static_cast<std::uint64_t>(most[axis] - cells.base[axis]));
  }
  cells.depth = static_cast<std::uint32_t>(std::bit_width(extent));
  if (cells.depth > kMortonBits) {
    return make_error(ErrorCode::kInvalidArgument, "more than 2^21 voxels across one tile");
  }
  return cells;
}

VoxelCoord relative(const LatticeCoord& at, const LatticeCoord& base) {
  return {static_cast<std::uint32_t>(at[0] - base[0]), static_cast<std::uint32_t>(at[1] - base[1]),
          static_cast<std::uint32_t>(at[2] - base[2])};
}

std::vector<KeyedIndex> sorted_keys(const Cells& cells) {
  std::vector<KeyedIndex> keys(cells.at.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    keys[i] = {morton_encode(relative(cells.at[i], cells.base)), static_cast<std::uint32_t>(i)};
  }
  std::vector<KeyedIndex> scratch;
  radix_sort(keys, scratch, static_cast<int>(3 * cells.depth));
  return keys;
}

Bytes write(const Cells& cells, const std::vector<KeyedIndex>& sorted, const PointsSettings& settings) {
  std::vector<std::uint64_t> keys;
  std::vector<std::uint32_t> counts;
  keys.reserve(sorted.size());
  counts.reserve(sorted.size());
  for (const KeyedIndex& k : sorted) {
    if (!keys.empty() && keys.back() == k.key) {
      ++counts.back();
    } else {
      keys.push_back(k.key);
      counts.push_back(1);
    }
  }
  ByteWriter out;
  for (const std::int64_t b : cells.base) out.signed_varint(b);
  out.u8(static_cast<std::uint8_t>(cells.depth));
  out.raw(encode_octree(keys, counts, cells.depth, {settings.effort, settings.keep_counts}));
  return out.take();
}

/// Fills order and voxels as the decoder will see them.
void list_points(const Cells& cells, const std::vector<KeyedIndex>& sorted, bool keep_counts,
                 PointsEncoding& out) {
  out.order.reserve(sorted.size());
  out.voxels.reserve(sorted.size());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    if (!keep_counts && i > 0 && sorted[i].key == sorted[i - 1].key) continue;
    out.order.push_back(sorted[i].index);
    out.voxels.push_back(relative(cells.at[sorted[i].index], cells.base));
  }
}

void measure(std::span<const Vec3> xyz, const Cells& cells, const Quantizer& quantizer, PointsEncoding& out) {
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double e = xyz[i][axis] - quantizer.centre(cells.at[i][axis], axis);
      out.sum_squared_error += e * e;
      out.max_axis_error_m = std::max(out.max_axis_error_m, std::abs(e));
    }
  }
}

}  // namespace

Result<PointsEncoding> encode_points(std::span<const Vec3> xyz, const Quantizer& quantizer,
                                     const PointsSettings& settings) {
  MAPCODEC_TRY(check(xyz, quantizer));
  MAPCODEC_ASSIGN(const Cells cells, to_lattice(xyz, quantizer));
  const std::vector<KeyedIndex> sorted = sorted_keys(cells);
  PointsEncoding out;
  out.bytes = write(cells, sorted, settings);
  list_points(cells, sorted, settings.keep_counts, out);
  out.decoded = voxel_centres(out.voxels, cells.base, quantizer);
  measure(xyz, cells, quantizer, out);
  return out;
}

}  // namespace mapcodec
