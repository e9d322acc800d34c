// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/octomap/octree_layer.hpp"

#include <cmath>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/codec/occupancy_decoder.hpp"

namespace mapcodec {
namespace {

// Keys times the ratio plus the offset are exact in double when both lie on this grid.
constexpr double kGrid = 0x1p20;

Status check_still(const std::string& name, const Vec3& translation_m,
                   const std::array<double, 4>& rotation_xyzw) {
  const auto& [x, y, z, w] = rotation_xyzw;
  if (translation_m == Vec3{0, 0, 0} && x == 0 && y == 0 && z == 0 && w != 0) return {};
  return make_error(
      ErrorCode::kUnsupported,
      "submap '" + name +
          "' holds an octree, which lies on its own grid and cannot be moved: leave its pose at "
          "0,0,0,0,0,0,1 (the verb pose sets it back), and after a correction make a new octree of the "
          "points (decompress --as bt, then update)");
}

}  // namespace

std::optional<std::uint32_t> octree_submap(const MapInfo& info) {
  const auto it = info.extras.find(kOctreeExtra);
  if (it == info.extras.end()) return std::nullopt;
  ByteReader in{ByteSpan(it->second)};
  const std::uint64_t submap = in.varint();
  if (!in.ok() || submap > 0xffffffffu) return std::nullopt;
  return static_cast<std::uint32_t>(submap);
}

Result<std::optional<OctreeLayer>> octree_layer(const MapInfo& info) {
  const auto it = info.extras.find(kOctreeExtra);
  if (it == info.extras.end()) return std::optional<OctreeLayer>();
  ByteReader in{ByteSpan(it->second)};
  OctreeLayer layer;
  layer.submap = static_cast<std::uint32_t>(in.varint());
  MAPCODEC_ASSIGN(layer.schema, read_schema(in.raw(in.left())));
  if (!occupancy_kind(layer.schema))
    return make_error(ErrorCode::kMalformed, "the schema of the map's octree is none");
  return std::optional<OctreeLayer>(std::move(layer));
}

Status check_octree_pose(const MapInfo& info) {
  const auto submap = octree_submap(info);
  if (!submap || *submap >= info.submaps.size()) return {};
  const Submap& s = info.submaps[*submap];
  return check_still(s.name, s.translation_m, s.rotation_xyzw);
}

Status check_octree_pose(const MapInfo& info, std::span<const PoseChange> changes) {
  const auto submap = octree_submap(info);
  for (const PoseChange& c : changes) {
    if (submap && c.submap == *submap && c.submap < info.submaps.size())
      MAPCODEC_TRY(check_still(info.submaps[c.submap].name, c.translation_m, c.rotation_xyzw));
  }
  return {};
}

Status check_holds_points(const MapInfo& info, std::uint32_t submap) {
  if (octree_submap(info) != submap) return {};
  const std::string name = submap < info.submaps.size() ? info.submaps[submap].name : "";
  return make_error(ErrorCode::kUnsupported,
                    "submap '" + name +
                        "' holds an octree and takes no points: give the points' submap another name, or "
                        "update with a .bt or .ot");
}

Bytes write_octree_layer(const OctreeLayer& layer) {
  ByteWriter out;
  out.varint(layer.submap);
  out.raw(write_schema(layer.schema));
  return out.take();
}

OctreePlaces::OctreePlaces(const MapSchema& octree, const MapInfo& info)
    : same_(false),
      octree_origin_m_(octree.origin),
      origin_m_(info.origin),
      resolution_m_(octree.tile_size_m),
      tile_size_m_(info.tile_size_m) {
  level_of_voxel_ = std::ilogb(resolution_m_ / tile_size_m_);
  ratio_ = std::ceil(std::ldexp(resolution_m_ / tile_size_m_, -level_of_voxel_) * kGrid) / kGrid;
  const int least = level_of_voxel_ < 0 ? -level_of_voxel_ : 0;
  fits_ = least <= int(kOccupancyHeight) && int(kOccupancyHeight) + level_of_voxel_ <= 30;
  least_height_ = static_cast<std::uint8_t>(fits_ ? least : 0);
  for (std::size_t d = 0; d < 3 && fits_; ++d) {
    for (const std::int32_t end : {0, 0xffff >> least_height_})
      fits_ = fits_ && std::abs(place(end, d, least_height_)) < 0x1p30;
  }
}

double OctreePlaces::place(std::int32_t key, std::size_t axis, unsigned height) const {
  const double side = std::ldexp(resolution_m_, int(height));
  const double cell = std::ldexp(tile_size_m_, int(height) + level_of_voxel_);
  const double offset = (octree_origin_m_[axis] + side / 2 - origin_m_[axis]) / cell;
  return std::floor(key * ratio_ + std::floor(offset * kGrid) / kGrid);
}

TileKey OctreePlaces::tile_of(const TileKey& k) const {
  if (same_) return k;
  return {static_cast<std::int32_t>(place(k.x, 0, k.level)),
          static_cast<std::int32_t>(place(k.y, 1, k.level)),
          static_cast<std::int32_t>(place(k.z, 2, k.level)),
          static_cast<std::uint8_t>(k.level + level_of_voxel_)};
}

TileKey OctreePlaces::octree_key_of(const TileKey& tile) const {
  if (same_) return tile;
  TileKey k;
  k.level = static_cast<std::uint8_t>(tile.level - level_of_voxel_);
  const std::int32_t want[3] = {tile.x, tile.y, tile.z};
  std::int32_t* const keys[3] = {&k.x, &k.y, &k.z};
  for (std::size_t d = 0; d < 3; ++d) {
    std::int32_t low = 0, high = 0xffff >> k.level;  // places ascend with the keys
    while (low < high) {
      const std::int32_t middle = low + (high - low) / 2;
      if (place(middle, d, k.level) < want[d])
        low = middle + 1;
      else
        high = middle;
    }
    *keys[d] = low;
  }
  return k;
}

}  // namespace mapcodec
