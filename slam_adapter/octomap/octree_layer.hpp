// SPDX-License-Identifier: GPL-3.0-or-later
// An octree in an archive of points: a submap of its own, whose tiles stand on the map's grid of tiles.
#pragma once

#include <optional>
#include <span>

#include "mapcodec/cloud/map_schema.hpp"
#include "maps/map_types.hpp"
#include "maps/submap_pose.hpp"

namespace mapcodec {

/// Name of the extra (maps/FORMAT.md 4.1) that says which submap holds an octree, and its schema.
inline constexpr const char* kOctreeExtra = "octree";

/// Number of the submap that holds an octree, if one does. Its tiles are no points of the map.
[[nodiscard]] std::optional<std::uint32_t> octree_submap(const MapInfo& info);

struct OctreeLayer {
  std::uint32_t submap = 0;
  MapSchema schema;  ///< one of occupancy_schema
};
/// Errors: Malformed.
[[nodiscard]] Result<std::optional<OctreeLayer>> octree_layer(const MapInfo& info);
[[nodiscard]] Bytes write_octree_layer(const OctreeLayer& layer);

/// An octree lies on its own grid, so it cannot follow a pose: turned or moved cells would have to be made
/// anew. Errors: Unsupported (the submap that holds the octree is not at the identity).
[[nodiscard]] Status check_octree_pose(const MapInfo& info);
/// Whether poses may be set so; back to the identity always.
[[nodiscard]] Status check_octree_pose(const MapInfo& info, std::span<const PoseChange> changes);

/// Errors: Unsupported (that submap holds an octree, so no points go there).
[[nodiscard]] Status check_holds_points(const MapInfo& info, std::uint32_t submap);

/// Between the keys of an octree's subtrees and those of the tiles that hold them. In an archive of octrees
/// alone they are the same. Else a subtree takes the cell of the map's grid where its centre lies, of the
/// largest side that is not above its own: no two meet, and bounds are told as closely as for points.
class OctreePlaces {
 public:
  OctreePlaces() = default;
  OctreePlaces(const MapSchema& octree, const MapInfo& info);

  /// Subtrees must be at least this high, so that cells of the grid are not larger than they.
  [[nodiscard]] std::uint8_t least_height() const { return least_height_; }
  /// Whether all keys are in the range of the grid's.
  [[nodiscard]] bool fits() const { return fits_; }
  [[nodiscard]] TileKey tile_of(const TileKey& octree_key) const;
  [[nodiscard]] TileKey octree_key_of(const TileKey& tile) const;

 private:
  [[nodiscard]] double place(std::int32_t key, std::size_t axis, unsigned height) const;

  bool same_ = true, fits_ = true;
  std::uint8_t least_height_ = 0;
  int level_of_voxel_ = 0;  ///< level = height + this
  double ratio_ = 1;        ///< side of a subtree to that of its tile, 1..2, on a grid of 2^-20
  Vec3 octree_origin_m_{}, origin_m_{};
  double resolution_m_ = 1, tile_size_m_ = 1;
};

}  // namespace mapcodec
