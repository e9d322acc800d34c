// SPDX-License-Identifier: GPL-3.0-or-later
// What compress, decompress and update do with octree files.
#pragma once

#include "slam_adapter/decompress.hpp"
#include "slam_adapter/octomap/occupancy_map.hpp"
#include "slam_adapter/update.hpp"

namespace mapcodec {

/// Whether any of the files is an octree.
[[nodiscard]] bool any_octree(const std::vector<std::string>& paths);

/// Octree files of one resolution and kind, later ones laid over earlier ones. Errors name the file.
/// Errors: those of read_octree; InvalidArgument (resolutions or kinds differ).
[[nodiscard]] Result<OctreeFile> read_octrees(const std::vector<std::string>& paths);

/// The octree of an archive, if it holds one, alone or beside points. Errors: those of OccupancyMap.
[[nodiscard]] Result<std::optional<OctreeFile>> octree_of(const MapFile& map, const ReadSettings& settings);

/// Octrees into a new archive. Errors: as read_octrees and create_occupancy_map.
[[nodiscard]] Result<CompressReport> compress_octrees(const std::vector<std::string>& inputs,
                                                      const std::string& path,
                                                      const CompressOptions& options);

/// Octrees into an existing map of octrees: what they know replaces what the map says there.
[[nodiscard]] Result<UpdateReport> update_octrees(const std::string& map_path, const UpdateRequest& request,
                                                  Arena& arena);

/// The map's octree, or the part that meets `region`, as a .bt or .ot. Errors: also Empty (nothing is known
/// there).
[[nodiscard]] Result<DecompressReport> decompress_octree(const std::string& map_path, const std::string& path,
                                                         const Region& region,
                                                         std::optional<std::uint64_t> revision,
                                                         const ReadSettings& settings);

}  // namespace mapcodec
