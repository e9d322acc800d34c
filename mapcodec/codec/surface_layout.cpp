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

constexpr std::uint8_t kFitted = 0x80;  // with the depth

Status read_fit(ByteReader& in, Header& h) {
  h.fitted = (h.depth & kFitted) != 0;
  if (!h.fitted) return {};
  h.depth &= static_cast<std::uint8_t>(~kFitted);
  h.borders = in.u8();
  bool valid = h.borders < 64;
  for (std::uint32_t& e : h.extent) {
    const std::uint64_t steps = in.varint();
    valid = valid && steps > 0 && steps <= kMostExtent;
    e = static_cast<std::uint32_t>(steps);
  }
  MAPCODEC_TRY(in.status("surface header"));
  if (!valid) return make_error(ErrorCode::kMalformed, "surface extent or borders out of range");
  return {};
}

}  // namespace

Outline outline_of(const Header& header) {
  Outline o;
  o.fitted = header.fitted;
  o.borders = header.borders;
  for (std::size_t d = 0; d < 3 && o.fitted; ++d) o.end[d] = header.extent[d] * kStepUnits;
  return o;
}

void write_header(ByteWriter& out, const Header& header) {
  out.u8(header.voxel_shift);
  for (const std::int64_t b : header.base) out.signed_varint(b);
  out.u8(header.fitted ? header.depth | kFitted : header.depth);
  if (header.fitted) {
    out.u8(header.borders);
    for (const std::uint32_t e : header.extent) out.varint(e);
  }
  out.u8(header.count_shift);
  out.u8(header.block_bits);
}

Result<Header> read_header(ByteReader& in) {
  Header h;
  h.voxel_shift = in.u8();
  for (std::int64_t& b : h.base) b = in.signed_varint();
  h.depth = in.u8();
  MAPCODEC_TRY(read_fit(in, h));
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
                                const Header& header, std::span<const Joint> joints) {
  std::uint64_t sum = 0;
  for (const Leaf& leaf : leaves) sum += leaf.block < 0 ? leaf.count : 0;
  for (const Block& block : blocks) sum += block.count;
  if (sum != count) return {};
  const Surroundings around = surroundings_of(leaves, joints, outline_of(header));
  std::vector<SubUnits> points = spread_leaves(leaves, blocks, header.block_bits, count, around);
  const std::int32_t over = header.fitted ? kOverlap << kSubUnitBits : 0;
  const std::int32_t most = (std::int32_t{1} << (header.depth + kSubUnitBits)) + over;
  for (SubUnits& p : points) {
    for (std::int32_t& v : p) v = std::clamp(v, -over, most);
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
  const std::int32_t most = std::int32_t{1} << (depth + kSubUnitBits);
  const auto voxel_of = [&](const SubUnits& p) {
    VoxelCoord at;
    for (std::size_t d = 0; d < 3; ++d)
      at[d] = static_cast<std::uint32_t>(std::clamp(p[d], 0, most)) >> voxel_shift;
    return at;
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
