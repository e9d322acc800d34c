// SPDX-License-Identifier: GPL-3.0-or-later
// Which clouds a measurement runs on.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "tools/bench/bench.hpp"

namespace mapcodec::bench {

struct BenchCloud {
  std::string path;
  std::string name;  ///< file name without extension, with characters that file names bear everywhere
  PointCloud cloud;  ///< finite points [m]
};

/// Readable point files below settings.data, sorted by path, restricted to settings.files.
/// Errors: NotFound.
[[nodiscard]] Result<std::vector<std::string>> find_clouds(const BenchSettings& settings);
/// Reads a file whole. Errors: those of the reader.
[[nodiscard]] Result<BenchCloud> load_cloud(const std::string& path);
/// Whether the points lie in a cone before the origin along z: one frame of a depth camera.
[[nodiscard]] bool is_camera_frame(const PointCloud& cloud);

}  // namespace mapcodec::bench
