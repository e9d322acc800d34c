// SPDX-License-Identifier: GPL-3.0-or-later
// OctoMap's objects in memory to archives and back. Names OctoMap's types only; the library mapcodec_octomap
// needs it.
#pragma once

#include <memory>

#include "slam_adapter/octomap/occupancy_map.hpp"

namespace octomap {
class OcTree;
class ColorOcTree;
}  // namespace octomap

namespace mapcodec {

// All of this takes trees by const reference and catches what OctoMap throws. Threads: as the trees'.

/// Every leaf and inner node, float bits and colours. Errors: Empty; Malformed (a tree that OctoMap could not
/// write).
[[nodiscard]] Result<OctreeFile> from_octomap(const octomap::OcTree& tree);
[[nodiscard]] Result<OctreeFile> from_octomap(const octomap::ColorOcTree& tree);

/// A tree of OctoMap's with the same nodes; binary leaves get the default clamping thresholds, as from a .bt.
/// Errors: InvalidArgument (to_octomap: never; to_color_octomap: a tree without colours).
[[nodiscard]] Result<std::unique_ptr<octomap::OcTree>> to_octomap(const OccupancyTree& tree,
                                                                  double resolution_m);
[[nodiscard]] Result<std::unique_ptr<octomap::ColorOcTree>> to_color_octomap(const OccupancyTree& tree,
                                                                             double resolution_m);

/// The map's octree in a box [m, map frame]: only tiles that meet it are read. Null: nothing is known there.
[[nodiscard]] Result<std::unique_ptr<octomap::OcTree>> read_octomap(const OccupancyMap& map,
                                                                    const Region& region,
                                                                    const ReadSettings& settings = {});

/// A new archive of a tree. `binary`: only occupied or free.
[[nodiscard]] Status create_octomap(const std::string& path, const octomap::OcTree& tree, bool binary,
                                    const OccupancyWrite& settings);
/// Brings the archive up to the tree. With change detection enabled only tiles in which keys have changed are
/// looked at (the caller then resets the detection); otherwise the whole tree is laid over the map. Errors:
/// those of update_occupancy_map.
[[nodiscard]] Result<UpdateReport> update_octomap(const std::string& path, const octomap::OcTree& tree,
                                                  const OccupancyWrite& settings);

struct RaySettings {
  double resolution_m = 0.1;
  double max_range_m = -1;  ///< longer rays are cut there and end free; < 0: none is
  std::optional<Vec3>
      origin_m;  ///< where the sensor stood for points of a map without submaps [m, map frame]
};
/// The points of a map as OctoMap sees them by its ray insertion with its default sensor model, made binary
/// and pruned. Rays begin at the poses of submaps; of points without one, at `origin_m`; without that, cells
/// are occupied where points are and nothing is free. Errors: those of MapFile::read; Empty.
[[nodiscard]] Result<OccupancyTree> insert_rays(const MapFile& map, const Region& region,
                                                const RaySettings& rays, const ReadSettings& settings);

}  // namespace mapcodec
