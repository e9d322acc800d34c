// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "slam_adapter/formats/bag_options.hpp"
#include "slam_adapter/map_updater.hpp"

namespace mapcodec {

/// Inserts each cloud of the ROS bag at `path` as a submap of its own, called TOPIC@SECONDS.NANOSECONDS, its
/// points in the sensor's frame, its pose from the bag (identity where the bag knows none). One scan is held
/// at a time. Not committed.
/// @param warnings  out: what was left out. Errors: those of BagScans and of MapUpdater::insert; Unsupported
/// (no bag; a build without bags).
[[nodiscard]] Status insert_scans(MapUpdater& map, const std::string& path, const BagOptions& options,
                                  std::vector<std::string>& warnings);

}  // namespace mapcodec
