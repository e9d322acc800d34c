// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/octomap/octree_target.hpp"

#include <algorithm>

#include "mapcodec/codec/occupancy_decoder.hpp"

namespace mapcodec {
namespace {

/// Points may be in a submap of the usual name.
std::string free_name(const std::vector<Submap>& submaps) {
  std::string name = "octree";
  const auto taken = [&](const Submap& s) { return s.name == name; };
  for (int i = 2; std::any_of(submaps.begin(), submaps.end(), taken); ++i)
    name = "octree-" + std::to_string(i);
  return name;
}

/// A submap of its own for the octree of a map of points.
Result<OctreeTarget> begin_layer(MapWriter& writer, OccupancyKind kind, double resolution_m) {
  MapInfo info = writer.info();
  OctreeTarget t;
  t.layer.schema = occupancy_schema(kind, resolution_m);
  t.places = OctreePlaces(t.layer.schema, info);
  if (!t.places.fits())
    return make_error(ErrorCode::kInvalidArgument,
                      "the octree's voxels do not fit the map's tiles, whose side is " +
                          std::to_string(info.tile_size_m) + " m");
  if (info.submaps.empty()) info.submaps.emplace_back();
  t.layer.submap = static_cast<std::uint32_t>(info.submaps.size());
  std::string name = free_name(info.submaps);
  info.submaps.emplace_back().name = std::move(name);
  info.extras[kOctreeExtra] = write_octree_layer(t.layer);
  MAPCODEC_TRY(writer.set_info(std::move(info)));
  return t;
}

}  // namespace

Result<OctreeTarget> octree_target(MapWriter& writer, OccupancyKind kind, double resolution_m) {
  MAPCODEC_ASSIGN(MapSchema schema, read_schema(writer.info().schema));
  if (occupancy_kind(schema)) return OctreeTarget{{0, std::move(schema)}, {}};
  MAPCODEC_ASSIGN(std::optional<OctreeLayer> layer, octree_layer(writer.info()));
  if (!layer) return begin_layer(writer, kind, resolution_m);
  MAPCODEC_TRY(check_octree_pose(writer.info()));
  const OctreePlaces places(layer->schema, writer.info());
  return OctreeTarget{std::move(*layer), places};
}

}  // namespace mapcodec
