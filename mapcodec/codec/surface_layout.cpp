// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_layout.hpp"

#include <algorithm>

#include "mapcodec/codec/surface_blocks.hpp"
#include "mapcodec/geometry/morton.hpp"
#include "mapcodec/geometry/radix_sort.hpp"

namespace mapcodec::surface {
namespace {

// GCC 12.2 at -O3 vectorises pairs of double -> float -> double into nothing; volatile keeps the rounding.
double rounded_to_float(double c) {
  const volatile float f = static_cast<float>(c);
  return f;
}

}  // namespace

void write_header(ByteWriter& out, const Header& header) {
  out.u8(header.voxel_shift);
  for (const std::int64_t b : header.base) out.signed_varint(b);
  out.u8(header.depth);
  out.u8(header.count_shift);
  out.u8(header.block_bits);
}

Result<Header> read_header(ByteReader& in) {
  Header h;
  h.voxel_shift = in.u8();
  for (std::int64_t& b : h.base) b = in.signed_varint();
  h.depth = in.u8();
  h.count_shift = in.u8();
  h.block_bits = in.u8();
  MAPCODEC_TRY(in.status("surface header"));
  const auto out_of_range = [](std::int64_t b) { return b > kMostBase || b < -kMostBase; };
  if (std::any_of(h.base.begin(), h.base.end(), out_of_range)) {
    return make_error(ErrorCode::kMalformed, "surface base out of range");
  }
  if (h.depth > kLongestSide || h.count_shift > kExactCounts || h.block_bits > kLongestSide) {
    return make_error(ErrorCode::kMalformed, "surface depth, count step or blocks out of range");
  }
  if (h.voxel_shift != kNoVoxels &&
      (h.voxel_shift < least_voxel_shift(h.depth) || h.voxel_shift > most_voxel_shift(h.depth))) {
    return make_error(ErrorCode::kMalformed, "surface voxels out of range");
  }
  return h;
}

std::vector<SubUnits> points_of(std::vector<Leaf>& leaves, std::span<const Block> blocks, std::size_t count,
                                const Header& header) {
  std::uint64_t sum = 0;
  for (const Leaf& leaf : leaves) sum += leaf.block < 0 ? leaf.count : 0;
  for (const Block& block : blocks) sum += block.count;
  if (sum != count) return {};
  std::vector<SubUnits> points = spread_leaves(leaves, blocks, header.block_bits, count);
  const std::int32_t most = std::int32_t{1} << (header.depth + kSubUnitBits);
  for (SubUnits& p : points) {
    for (std::int32_t& v : p) v = std::clamp(v, 0, most);
  }
  return points;
}

std::vector<Vec3> positions(const std::vector<SubUnits>& points, const std::array<std::int64_t, 3>& base,
                            const Quantizer& lattice) {
  const double side = lattice.step_m / kSubUnitsPerStep;
  std::array<std::int64_t, 3> first;
  for (std::size_t d = 0; d < 3; ++d) first[d] = base[d] * (1 << kSubUnitBits);
  const bool to_float = lattice.kind == CoordinateFormat::Kind::f32;
  std::vector<Vec3> xyz(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t d = 0; d < 3; ++d) {
      const double x = lattice.origin[d] + static_cast<double>(first[d] + points[i][d]) * side;
      xyz[i][d] = to_float ? rounded_to_float(x) : x;
    }
  }
  return xyz;
}

VoxelOrder order_by_voxels(const std::vector<SubUnits>& points, unsigned depth, std::uint8_t voxel_shift) {
  const auto voxel_of = [&](const SubUnits& p) {
    return VoxelCoord{static_cast<std::uint32_t>(p[0]) >> voxel_shift,
                      static_cast<std::uint32_t>(p[1]) >> voxel_shift,
                      static_cast<std::uint32_t>(p[2]) >> voxel_shift};
  };
  std::vector<KeyedIndex> keys(points.size()), scratch;
  for (std::size_t i = 0; i < points.size(); ++i) {
    keys[i] = {morton_encode(voxel_of(points[i])), static_cast<std::uint32_t>(i)};
  }
  // Points on the far faces of the root cell need one bit more.
  radix_sort(keys, scratch, 3 * (static_cast<int>(depth) + kSubUnitBits - voxel_shift + 1));
  VoxelOrder r;
  r.order.reserve(keys.size());
  r.voxels.reserve(keys.size());
  for (const KeyedIndex& k : keys) {
    r.order.push_back(k.index);
    r.voxels.push_back(morton_decode(k.key));
  }
  return r;
}

}  // namespace mapcodec::surface
