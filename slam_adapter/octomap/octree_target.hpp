// SPDX-License-Identifier: GPL-3.0-or-later
// Where an octree that is written to an archive will stand.
#pragma once

#include "maps/map_writer.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"

namespace mapcodec {

struct OctreeTarget {
  OctreeLayer layer;
  OctreePlaces places;
};

/// Of a map of octrees the map itself; of a map of points the submap of its own that holds the octree, which
/// the writer's next revision gets if there is none.
/// Errors: Malformed; InvalidArgument (voxels that do not fit the map's tiles); Unsupported (the octree was
/// moved by a pose).
[[nodiscard]] Result<OctreeTarget> octree_target(MapWriter& writer, OccupancyKind kind, double resolution_m);

}  // namespace mapcodec
