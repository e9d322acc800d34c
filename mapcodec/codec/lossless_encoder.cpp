// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/lossless_encoder.hpp"

#include <memory>

#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/lossless_bits.hpp"
#include "mapcodec/codec/lossless_layout.hpp"
#include "mapcodec/codec/lossless_rest.hpp"
#include "mapcodec/codec/octree_encoder.hpp"
#include "mapcodec/geometry/morton.hpp"

namespace mapcodec {
namespace {

Bytes encode_cells(const LosslessLayout& layout, Effort effort) {
  std::vector<std::uint64_t> keys;
  std::vector<std::uint32_t> counts;
  for (const std::uint64_t k : layout.keys) {
    if (keys.empty() || keys.back() != k) {
      keys.push_back(k);
      counts.push_back(0);
    }
    ++counts.back();
  }
  return encode_octree(keys, counts, layout.depth, {effort, true});
}

/// The points' bits below their cells.
class RestWriter {
 public:
  explicit RestWriter(const std::array<AxisGrid, 3>& grids) : grids_(grids) {}

  /// @param may_repeat  `before` is the point before, in the same cell.
  void add(const Vec3& p, const Vec3& before, bool may_repeat) {
    patch(p);
    ++points_;
    if (may_repeat && models_.code_repeat(side_, same(p, before))) return;
    for (std::size_t d = 0; d < 3; ++d) {
      const GridValue v = grids_[d].split(p[d]);
      if (grids_[d].touches_zero(v.cell)) models_.depth[d].code(side_, v.depth - 1);
      rest_.put(v.rest, v.rest_bits);
    }
  }
  Bytes side() { return side_.finish(); }
  Bytes rest() { return rest_.finish(); }
  Bytes patches() { return patches_.take(); }

 private:
  // In one cell of floats there are not both zeros; lattices take them for one, and patches tell them apart.
  static bool same(const Vec3& a, const Vec3& b) { return a == b; }

  /// Notes the numbers that are off their lattice.
  void patch(const Vec3& p) {
    for (std::size_t d = 0; d < 3; ++d) {
      if (grids_[d].kind != AxisGrid::Kind::lattice) continue;
      const auto bits = std::bit_cast<std::uint64_t>(p[d]);
      if (std::bit_cast<std::uint64_t>(grids_[d].join(grids_[d].split(p[d]))) == bits) continue;
      patches_.varint((points_ - last_patched_) * 3 + d);
      patches_.u64(bits);
      last_patched_ = points_;
    }
  }

  const std::array<AxisGrid, 3>& grids_;
  SymbolWriter side_;
  BitWriter rest_;
  RestModels models_;
  ByteWriter patches_;
  std::uint64_t points_ = 0, last_patched_ = 0;
};

void encode_finite(std::span<const Vec3> xyz, const LosslessLayout& layout, Effort effort, ByteWriter& out) {
  for (const AxisGrid& g : layout.grids) write_grid(out, g);
  for (const std::int64_t b : layout.base) out.signed_varint(b);
  out.u8(static_cast<std::uint8_t>(layout.depth));
  out.sized(encode_cells(layout, effort));
  RestWriter rest(layout.grids);
  for (std::size_t i = 0; i < layout.order.size(); ++i) {
    const bool may_repeat = i > 0 && layout.keys[i] == layout.keys[i - 1];
    rest.add(xyz[layout.order[i]], xyz[layout.order[i - (i > 0)]], may_repeat);
  }
  out.sized(rest.side());
  out.sized(rest.rest());
  out.sized(rest.patches());
}

Bytes encode_odd(std::span<const Vec3> xyz, std::span<const std::uint32_t> odd) {
  SymbolWriter side;
  const auto points = std::make_unique<OddPoints>();
  for (const std::uint32_t i : odd) points->code(side, xyz[i]);
  return side.finish();
}

}  // namespace

Result<LosslessEncoding> encode_lossless(std::span<const Vec3> xyz, const CoordinateFormat& format,
                                         const Vec3& /*origin*/, Effort effort) {
  if (xyz.size() > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::kInvalidArgument, "a tile of more than 2^32 points");
  }
  std::vector<std::uint32_t> finite, odd;
  for (std::size_t i = 0; i < xyz.size(); ++i)
    (is_finite(xyz[i]) ? finite : odd).push_back(static_cast<std::uint32_t>(i));
  ByteWriter out;
  LosslessEncoding r;
  out.varint(odd.size());
  if (!finite.empty()) {
    LosslessLayout layout = lay_out_lossless(xyz, finite, format, effort);
    encode_finite(xyz, layout, effort, out);
    for (const std::uint64_t k : layout.keys) r.voxels.push_back(morton_decode(k));
    r.order = std::move(layout.order);
  }
  if (!odd.empty()) out.raw(encode_odd(xyz, odd));
  r.voxels.resize(xyz.size(), r.voxels.empty() ? VoxelCoord{} : r.voxels.back());
  r.order.insert(r.order.end(), odd.begin(), odd.end());
  r.bytes = out.take();
  return r;
}

}  // namespace mapcodec
