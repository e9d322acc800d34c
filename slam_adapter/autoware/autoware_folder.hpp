// SPDX-License-Identifier: GPL-3.0-or-later
// Map folders of Autoware: tiles of PCD and a file that says where they lie.
#pragma once

#include "slam_adapter/decompress.hpp"
#include "slam_adapter/formats/formats.hpp"

namespace mapcodec {

/// Whether `folder` holds pointcloud_map_metadata.yaml.
[[nodiscard]] bool is_autoware_folder(const std::string& folder);
/// The tiles that the metadata names as one cloud, in its order; they lie beside it, in pointcloud_map.pcd/
/// or in pointcloud_map/. One is open at a time. Errors: those of a tile and of parse_autoware_metadata;
/// NotFound (a tile); InvalidArgument (channels that not all have).
[[nodiscard]] Result<std::unique_ptr<PointSource>> open_autoware_folder(const std::string& folder,
                                                                        const ReadOptions& options);
/// Size of the tiles. Errors: as for opening.
[[nodiscard]] Result<std::uint64_t> autoware_folder_bytes(const std::string& folder);

struct AutowareExport {
  double tile_size_m = 20;  ///< of x and y; whole metres, since Autoware's loader reads corners as integers
  WriteOptions write;
  bool overwrite = false;  ///< an Autoware folder that stands at the place
};
struct AutowareReport : DecompressReport {
  std::uint64_t tiles = 0;            ///< written
  std::vector<std::string> warnings;  ///< what the files do not hold
};

/// Writes the points of `region` as a map folder: FOLDER/pointcloud_map.pcd/X_Y.pcd and the metadata. A tile
/// has the points with x in [X, X + size) and y alike, in coordinates of float32, which is all that Autoware
/// reads. The folder appears when it is complete. Memory: about eight million points at a time.
/// Errors: those of MapFile; InvalidArgument (size), Empty, CannotWrite (also where something stands at
/// `folder`).
[[nodiscard]] Result<AutowareReport> export_autoware(const std::string& map_path, const std::string& folder,
                                                     const Region& region,
                                                     std::optional<std::uint64_t> revision,
                                                     const ReadSettings& settings,
                                                     const AutowareExport& options);

}  // namespace mapcodec
