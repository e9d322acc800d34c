// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_decoder.hpp"

#include <memory>

#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/codec/surface_layout.hpp"
#include "mapcodec/geometry/radix_sort.hpp"

namespace mapcodec {
namespace {

using surface::SubUnits;

// A level has at most as many cells as there are points, and so have the leaves in and out of blocks: two
// levels, leaves, points in both forms, and what sorting takes.
constexpr std::uint64_t kCellBytes = 112;
constexpr std::uint64_t kBytesPerPoint = 2 * kCellBytes + 2 * sizeof(surface::Leaf) + 2 * sizeof(SubUnits) +
                                         sizeof(Vec3) + sizeof(VoxelCoord) + 2 * sizeof(KeyedIndex);

Status check_count(std::uint64_t count, const DecodeLimits& limits) {
  if (count == 0) return make_error(ErrorCode::kMalformed, "surface tile without points");
  if (count > limits.max_points || count > limits.max_bytes / kBytesPerPoint || count > 0x7fffffffu) {
    return make_error(ErrorCode::kLimitExceeded, "surface points need more memory than allowed");
  }
  return {};
}

Result<std::vector<SubUnits>> decode_tree(ByteSpan code, std::uint32_t count, const surface::Header& header,
                                          unsigned levels) {
  SymbolReader reader(code);
  // The models are too large for small stacks.
  const auto walk = std::make_unique<surface::Walk<SymbolReader>>(reader);
  walk->models().count_shift = header.count_shift;
  walk->models().voxel_bits = header.block_bits;
  if (!walk->run(count, header.depth, levels)) {
    return make_error(ErrorCode::kTruncated, "surface tree ends too early");
  }
  return surface::points_of(walk->leaves(), walk->blocks(), count, header);
}

std::vector<SubUnits> gather(const std::vector<SubUnits>& points, const std::vector<std::uint32_t>& order) {
  std::vector<SubUnits> r;
  r.reserve(order.size());
  for (const std::uint32_t i : order) r.push_back(points[i]);
  return r;
}

}  // namespace

Result<DecodedPoints> decode_surface(ByteSpan bytes, std::uint64_t count, const Quantizer& lattice,
                                     const DecodeLimits& limits, unsigned levels) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const surface::Header header, surface::read_header(in));
  MAPCODEC_TRY(check_count(count, limits));
  MAPCODEC_ASSIGN(std::vector<SubUnits> points,
                  decode_tree(in.raw(in.left()), static_cast<std::uint32_t>(count), header, levels));
  if (points.size() != count) return make_error(ErrorCode::kMalformed, "surface tree has not its points");
  DecodedPoints r;
  if (header.voxel_shift != surface::kNoVoxels) {
    surface::VoxelOrder sorted = surface::order_by_voxels(points, header.depth, header.voxel_shift);
    points = gather(points, sorted.order);
    r.voxels = std::move(sorted.voxels);
  }
  r.xyz = surface::positions(points, header.base, lattice);
  return r;
}

}  // namespace mapcodec
