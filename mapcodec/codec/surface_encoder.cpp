// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_encoder.hpp"

#include <bit>
#include <cmath>
#include <limits>
#include <memory>

#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/codec/surface_optimizer.hpp"
#include "mapcodec/geometry/morton.hpp"
#include "mapcodec/geometry/radix_sort.hpp"

namespace mapcodec {
namespace {

using surface::Units;

/// The tile in units of its root cell.
struct UnitTile {
  std::vector<Units> points;  ///< Morton-sorted, x highest
  surface::Header header;
};

Status check(std::span<const Vec3> xyz, const Quantizer& lattice, const SurfaceTrade& trade) {
  if (xyz.empty()) return make_error(ErrorCode::kEmpty, "no points to encode");
  if (!(lattice.step_m > 0) || !std::isfinite(lattice.step_m) || !is_finite(lattice.origin)) {
    return make_error(ErrorCode::kInvalidArgument, "surface step or origin is not a proper number");
  }
  const bool fair = trade.bit_price > 0 && std::isfinite(trade.bit_price) && trade.forward_weight > 0 &&
                    trade.forward_weight < 1;
  if (!fair) return make_error(ErrorCode::kInvalidArgument, "bit price or weight out of range");
  if (xyz.size() > std::numeric_limits<std::uint32_t>::max() / 2) {
    return make_error(ErrorCode::kInvalidArgument, "too many points in one tile");
  }
  return {};
}

/// Says how far the points reach, and at which faces of the tile's cube they go on in the next tile.
void fit_outline(const std::array<std::uint64_t, 3>& reach, const Box& box, const Quantizer& lattice,
                 const TileBorders& borders, surface::Header& header) {
  header.fitted = true;
  const double near = lattice.step_m / 2;
  for (unsigned d = 0; d < 3; ++d) {
    const bool low = borders.goes_on(d, false) && box.min[d] - borders.cube.min[d] < near;
    const bool high = borders.goes_on(d, true) && borders.cube.max[d] - box.max[d] < near;
    header.borders |= static_cast<std::uint8_t>((low ? 1u : 0u) << (2 * d) | (high ? 2u : 0u) << (2 * d));
    // At a border a little less will do: the surface goes beyond it anyway.
    const std::uint64_t units = reach[d] + 1;
    const std::uint64_t steps =
        (units + surface::kStepUnits - (high ? surface::kOverlap * 2 / 3 : 1)) / surface::kStepUnits;
    header.extent[d] = static_cast<std::uint32_t>(std::clamp<std::uint64_t>(steps, 1, surface::kMostExtent));
  }
}

/// The box of the points, whose root cell begins at its lowest unit.
Result<surface::Header> place_root(std::span<const Vec3> xyz, const Quantizer& lattice, double unit,
                                   const TileBorders& borders) {
  Box box;
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    if (!is_finite(xyz[i])) {
      return make_error(ErrorCode::kInvalidArgument, "point " + std::to_string(i) + " is not finite");
    }
    box.add(xyz[i]);
  }
  surface::Header header;
  std::uint64_t extent = 0;
  std::array<std::uint64_t, 3> reach{};
  for (std::size_t d = 0; d < 3; ++d) {
    const double low = std::floor((box.min[d] - lattice.origin[d]) / unit);
    const double high = std::floor((box.max[d] - lattice.origin[d]) / unit);
    if (!(std::abs(low) < double(surface::kMostBase)) || !(std::abs(high) < double(surface::kMostBase))) {
      return make_error(ErrorCode::kInvalidArgument, "points too far away for this step");
    }
    header.base[d] = static_cast<std::int64_t>(low);
    reach[d] = static_cast<std::uint64_t>(high - low);
    extent = std::max(extent, reach[d]);
  }
  const int depth = std::bit_width(extent);
  if (depth > surface::kLongestSide) {
    return make_error(ErrorCode::kInvalidArgument, "more than 2^16 surface steps across one tile");
  }
  header.depth = static_cast<std::uint8_t>(depth);
  fit_outline(reach, box, lattice, borders, header);
  return header;
}

Result<UnitTile> to_units(std::span<const Vec3> xyz, const Quantizer& lattice, const TileBorders& borders) {
  const double unit = lattice.step_m / surface::kStepUnits;
  UnitTile tile;
  MAPCODEC_ASSIGN(tile.header, place_root(xyz, lattice, unit, borders));
  std::vector<KeyedIndex> keys(xyz.size()), scratch;
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    VoxelCoord at;
    for (std::size_t d = 0; d < 3; ++d) {
      at[2 - d] = static_cast<std::uint32_t>(
          static_cast<std::int64_t>(std::floor((xyz[i][d] - lattice.origin[d]) / unit)) -
          tile.header.base[d]);
    }
    keys[i] = {morton_encode(at), static_cast<std::uint32_t>(i)};
  }
  radix_sort(keys, scratch, 3 * tile.header.depth);
  tile.points.reserve(xyz.size());
  for (const KeyedIndex& k : keys) {
    const VoxelCoord at = morton_decode(k.key);
    tile.points.push_back({static_cast<std::int32_t>(at[2]), static_cast<std::int32_t>(at[1]),
                           static_cast<std::int32_t>(at[0])});
  }
  return tile;
}

using Writing = surface::Walk<SymbolWriter>;

/// Coarse counts are for leaves of many points: where leaves hold few, a count that is off by one costs more
/// than it saves.
constexpr std::uint8_t kCoarseCounts = 6;
constexpr std::size_t kManyPoints = 64;  // a leaf, on average

std::size_t count_leaves(const std::vector<surface::Choice>& choices) {
  std::size_t leaves = 0;
  for (const surface::Choice& c : choices) leaves += c.child[0] < 0 && c.child[1] < 0;
  return leaves;
}

void set_up(surface::Models& models, const surface::Header& header) {
  models.count_shift = header.count_shift;
  models.outline = outline_of(header);
  models.voxel_bits = header.block_bits;
}

/// Chooses and writes; a second pass knows what symbols cost from the first.
Bytes code_tree(UnitTile& tile, const SurfaceSettings& settings, std::vector<surface::SubUnits>& points) {
  const int passes = settings.effort == Effort::high ? 2 : 1;
  tile.header.count_shift = kCoarseCounts;
  tile.header.block_bits = tile.header.depth > surface::kBlockBits ? surface::kBlockBits : std::uint8_t{0};
  auto models = std::make_unique<surface::Models>();
  for (int pass = 1;; ++pass) {
    set_up(*models, tile.header);
    const std::vector<surface::Choice> choices =
        choose_cells(tile.points, tile.header.depth, *models, settings.trade);
    if (tile.points.size() < kManyPoints * count_leaves(choices))
      tile.header.count_shift = surface::kExactCounts;
    SymbolWriter side;
    const auto walk = std::make_unique<Writing>(side, choices);
    set_up(walk->models(), tile.header);
    walk->run(static_cast<std::uint32_t>(tile.points.size()), tile.header.depth, 3u * surface::kLongestSide);
    if (pass < passes) {
      *models = walk->models();
      continue;
    }
    points =
        surface::points_of(walk->leaves(), walk->blocks(), tile.points.size(), tile.header, walk->joints());
    return side.finish();
  }
}

}  // namespace

Result<SurfaceEncoding> encode_surface(std::span<const Vec3> xyz, const Quantizer& lattice,
                                       const SurfaceSettings& settings) {
  MAPCODEC_TRY(check(xyz, lattice, settings.trade));
  MAPCODEC_ASSIGN(UnitTile tile, to_units(xyz, lattice, settings.borders));
  SurfaceEncoding e;
  const Bytes code = code_tree(tile, settings, e.points);
  e.header = tile.header;
  ByteWriter out;
  surface::write_header(out, e.header);
  out.raw(code);
  e.bytes = out.take();
  e.decoded = surface::positions(e.points, e.header.base, lattice);
  return e;
}

surface::VoxelOrder set_voxels(SurfaceEncoding& encoding, std::uint8_t voxel_shift) {
  encoding.header.voxel_shift = voxel_shift;
  encoding.bytes.front() = voxel_shift;
  return surface::order_by_voxels(encoding.points, encoding.header.depth, voxel_shift);
}

}  // namespace mapcodec
