// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_decoder.hpp"

#include <algorithm>
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
                                         sizeof(Vec3) + sizeof(VoxelCoord) + 2 * sizeof(KeyedIndex) +
                                         surface::kJoinedBytesPerPoint;

Status check_count(std::uint64_t count, const DecodeLimits& limits) {
  if (count == 0) return make_error(ErrorCode::kMalformed, "surface tile without points");
  if (count > limits.max_points || count > limits.max_bytes / kBytesPerPoint || count > 0x7fffffffu) {
    return make_error(ErrorCode::kLimitExceeded, "surface points need more memory than allowed");
  }
  return {};
}

template <class Side>
bool read_tree(surface::Walk<Side>& walk, std::uint64_t count, const surface::Header& header,
               unsigned levels) {
  walk.models().count_shift = header.count_shift;
  walk.models().outline = outline_of(header);
  walk.models().voxel_bits = header.block_bits;
  return walk.run(static_cast<std::uint32_t>(count), header.depth, levels);
}

Error ended() {
  return make_error(ErrorCode::kTruncated, "surface tree ends too early");
}

/// Cells that the end of the levels cut short are taken for voxels of their size: those of blocks among them,
/// and those that have no plane, each a block of its own.
/// @return log2 of the voxels' side.
std::uint8_t settle_cut(std::vector<surface::Leaf>& leaves, std::vector<surface::Block>& blocks,
                        const surface::Header& header, unsigned levels) {
  if (levels >= 3u * header.depth) return header.block_bits;
  const auto side = static_cast<std::uint8_t>(header.depth - levels / 3);
  if (side < header.block_bits) return header.block_bits;
  const surface::CellShape cut{side, side, side};
  for (surface::Leaf& leaf : leaves) {
    if (leaf.block >= 0 || leaf.has_plane || leaf.shape != cut) continue;
    leaf.block = static_cast<std::int32_t>(blocks.size());
    blocks.push_back({leaf.count, 0});
  }
  return side;
}

Result<std::vector<SubUnits>> decode_tree(ByteSpan code, std::uint64_t count, const surface::Header& header,
                                          unsigned levels) {
  SymbolReader reader(code);
  // The models are too large for small stacks.
  const auto walk = std::make_unique<surface::Walk<SymbolReader>>(reader);
  if (!read_tree(*walk, count, header, levels)) return ended();
  std::vector<surface::Block> blocks = walk->blocks();
  surface::Header seen = header;
  seen.block_bits = settle_cut(walk->leaves(), blocks, header, levels);
  return surface::points_of(walk->leaves(), blocks, count, seen, walk->joints());
}

/// Notes how far it has read at the end of each binary level.
class LevelReader : public SymbolReader {
 public:
  explicit LevelReader(ByteSpan bytes) : SymbolReader(bytes), size_(bytes.size()) { end_level(); }
  void end_level() { ends_.push_back(size_ - left()); }
  [[nodiscard]] const std::vector<std::uint64_t>& ends() const { return ends_; }

 private:
  std::size_t size_;
  std::vector<std::uint64_t> ends_;
};

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
                  decode_tree(in.raw(in.left()), count, header, levels - levels % 3));
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

Result<std::vector<std::uint64_t>> surface_level_bytes(ByteSpan bytes, std::uint64_t count,
                                                       const DecodeLimits& limits) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const surface::Header header, surface::read_header(in));
  MAPCODEC_TRY(check_count(count, limits));
  const std::size_t before = in.offset();
  LevelReader reader(in.raw(in.left()));
  const auto walk = std::make_unique<surface::Walk<LevelReader>>(reader);
  if (!read_tree(*walk, count, header, kAllSurfaceLevels)) return ended();
  std::vector<std::uint64_t> r;
  const std::vector<std::uint64_t>& ends = reader.ends();
  for (std::size_t i = 0; i < ends.size() + 2; i += 3)
    r.push_back(before + ends[std::min(i, ends.size() - 1)]);
  return r;
}

}  // namespace mapcodec
