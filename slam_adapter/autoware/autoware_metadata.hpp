// SPDX-License-Identifier: GPL-3.0-or-later
// The file beside the tiles of an Autoware map that says where they lie.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

inline constexpr const char* kAutowareMetadataFile = "pointcloud_map_metadata.yaml";
/// Where Autoware's launch files look for the tiles of a map folder; a folder, in spite of its name.
inline constexpr const char* kAutowareTileFolder = "pointcloud_map.pcd";

struct AutowareMetadata {
  struct Tile {
    std::string file;     ///< name without folder
    double x = 0, y = 0;  ///< the corner with the smallest coordinates [m]
  };
  double x_resolution_m = 0, y_resolution_m = 0;  ///< sides of every tile
  std::vector<Tile> tiles;
};

/// Errors: Malformed (no YAML, no sizes, a tile without two numbers, a name with a folder), Empty (no tile).
[[nodiscard]] Result<AutowareMetadata> parse_autoware_metadata(const std::string& text);
/// Whole numbers are written as such, since Autoware's loader reads corners as integers.
[[nodiscard]] std::string format_autoware_metadata(const AutowareMetadata& metadata);

}  // namespace mapcodec
