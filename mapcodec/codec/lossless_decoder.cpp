// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/lossless_decoder.hpp"

#include <memory>

#include "mapcodec/codec/lossless_bits.hpp"
#include "mapcodec/codec/lossless_grid.hpp"
#include "mapcodec/codec/lossless_rest.hpp"
#include "mapcodec/codec/octree_decoder.hpp"
#include "mapcodec/geometry/morton.hpp"

namespace mapcodec {
namespace {

using Grids = std::array<AxisGrid, 3>;
using Cell = std::array<std::int64_t, 3>;

struct Head {
  Grids grids;
  Cell base{};
  std::uint32_t depth = 0;
  ByteSpan octree, side, rest, patches;
};

Result<Head> read_head(ByteReader& in, const CoordinateFormat& format) {
  Head h;
  for (std::size_t d = 0; d < 3; ++d) {
    MAPCODEC_ASSIGN(h.grids[d], read_grid(in, format, d));
  }
  for (std::int64_t& b : h.base) {
    b = in.signed_varint();
    if (b >= AxisGrid::kMostCell || b <= -AxisGrid::kMostCell) {
      return make_error(ErrorCode::kMalformed, "cells out of range", in.offset());
    }
  }
  h.depth = in.u8();
  h.octree = in.sized();
  h.side = in.sized();
  h.rest = in.sized();
  h.patches = in.sized();
  MAPCODEC_TRY(in.status("lossless geometry"));
  if (h.depth > kMortonBits) return make_error(ErrorCode::kMalformed, "octree too deep", in.offset());
  return h;
}

class FiniteReader {
 public:
  explicit FiniteReader(const Head& head) : head_(head), side_(head.side), rest_(head.rest) {}

  /// The points of one cell of the octree.
  bool read_cell(const VoxelCoord& voxel, std::uint32_t count, LosslessDecoded& out) {
    for (std::uint32_t i = 0; i < count; ++i) {
      const bool repeated = i > 0 && models_.code_repeat(side_, false);
      out.xyz.push_back(repeated ? out.xyz.back() : read_point(voxel));
      out.voxels.push_back(voxel);
      if (!side_.ok() || !rest_.ok() || !is_finite(out.xyz.back())) return false;
    }
    return true;
  }

 private:
  Vec3 read_point(const VoxelCoord& voxel) {
    Vec3 p{};
    for (std::size_t d = 0; d < 3; ++d) {
      const AxisGrid& grid = head_.grids[d];
      GridValue v;
      v.cell = head_.base[d] + voxel[d];
      if (grid.touches_zero(v.cell)) {
        const std::uint64_t depth = models_.depth[d].code(side_, 0);
        // Nothing lies below the smallest binade: damaged.
        if (depth >= grid.most_depth()) return {NAN, NAN, NAN};
        v.depth = static_cast<std::uint32_t>(depth) + 1;
      }
      v.rest = rest_.get(grid.rest_bits(v.cell));
      p[d] = grid.join(v);
    }
    return p;
  }

  const Head& head_;
  SymbolReader side_;
  BitReader rest_;
  RestModels models_;
};

/// Puts the numbers in place that are off their axis's lattice.
Status patch(ByteSpan patches, std::vector<Vec3>& xyz) {
  ByteReader in(patches);
  std::uint64_t at = 0;
  while (in.left() > 0) {
    const std::uint64_t step = in.varint();
    const double x = in.f64();
    MAPCODEC_TRY(in.status("patches"));
    if (step / 3 >= xyz.size() - at || !std::isfinite(x))
      return make_error(ErrorCode::kMalformed, "patch of no point");
    at += step / 3;
    xyz[at][step % 3] = x;
  }
  return {};
}

Status decode_finite(ByteReader& in, std::uint64_t count, const CoordinateFormat& format,
                     const DecodeLimits& limits, LosslessDecoded& out) {
  MAPCODEC_ASSIGN(const Head head, read_head(in, format));
  MAPCODEC_ASSIGN(const DecodedOctree tree, decode_octree(head.octree, count, head.depth, limits));
  FiniteReader reader(head);
  for (std::size_t i = 0; i < tree.keys.size(); ++i) {
    if (tree.counts[i] > count - out.xyz.size() ||
        !reader.read_cell(morton_decode(tree.keys[i]), tree.counts[i], out)) {
      return make_error(ErrorCode::kMalformed, "lossless coordinates are damaged", in.offset());
    }
  }
  if (out.xyz.size() != count)
    return make_error(ErrorCode::kMalformed, "lossless tile lacks points", in.offset());
  return patch(head.patches, out.xyz);
}

Status decode_odd(ByteReader& in, std::uint64_t count, LosslessDecoded& out) {
  const VoxelCoord voxel = out.voxels.empty() ? VoxelCoord{} : out.voxels.back();
  SymbolReader side(in.raw(in.left()));
  const auto points = std::make_unique<OddPoints>();
  for (std::uint64_t i = 0; i < count; ++i) {
    out.xyz.push_back(points->code(side, {}));
    out.voxels.push_back(voxel);
    if (!side.ok())
      return make_error(ErrorCode::kTruncated, "points that are not finite end too early", in.offset());
  }
  return {};
}

}  // namespace

Result<LosslessDecoded> decode_lossless(ByteSpan bytes, std::uint64_t count, const CoordinateFormat& format,
                                        const Vec3& /*origin*/, const DecodeLimits& limits) {
  // Points, voxels, keys and counts.
  if (count > limits.max_points || count > limits.max_bytes / 64) {
    return make_error(ErrorCode::kLimitExceeded, "tile announces " + std::to_string(count) + " points");
  }
  ByteReader in(bytes);
  const std::uint64_t odd = in.varint();
  MAPCODEC_TRY(in.status("lossless geometry"));
  if (odd > count) return make_error(ErrorCode::kMalformed, "more odd points than points", 0);
  LosslessDecoded out;
  if (count > odd) MAPCODEC_TRY(decode_finite(in, count - odd, format, limits, out));
  if (odd > 0) MAPCODEC_TRY(decode_odd(in, odd, out));
  return out;
}

}  // namespace mapcodec
