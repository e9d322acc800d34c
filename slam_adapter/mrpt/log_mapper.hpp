// SPDX-License-Identifier: GPL-3.0-or-later
// A log of MRPT's becomes a map: each keyframe a submap with its pose, committed as the log goes on.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "slam_adapter/compress.hpp"
#include "slam_adapter/local_map_view.hpp"
#include "slam_adapter/map_updater.hpp"
#include "slam_adapter/mrpt/log_poses.hpp"

namespace mapcodec {

/// Where a scan was taken. @param scan  [m, vehicle frame] @param view  the map around the guess.
/// @return T_map_vehicle, or an error: the scan does not fit.
using Registrar =
    std::function<Result<MapPose>(const PointCloud& scan, const LocalMapView& view, const MapPose& guess)>;

struct LogMapRequest {
  enum class Poses { best, file, log, odometry, icp };

  std::string log, map;
  RawlogOptions read;  ///< sensors and decimation
  Poses poses = Poses::best;
  std::string pose_file;    ///< with `file`
  Registrar registrar;      ///< with `icp`, for scans that are not flat; those go to MRPT's ICP
  double keyframe_m = 0;    ///< an observation is a keyframe where the vehicle has moved this far ...
  double keyframe_rad = 0;  ///< ... or turned this much since the last one; 0 and 0: every observation is
  CompressOptions create;   ///< promise, channels, tile size, overwrite, stop, progress, memory, threads
  bool pending = false;     ///< code quickly, and leave it to `compact` to code for good
  std::int64_t timestamp_s = 0;
};

struct LogMapReport {
  std::uint64_t keyframes = 0, frames = 0, points = 0;
  std::uint64_t without_pose = 0, thinned_out = 0, lost = 0;  ///< observations that are not in the map
  std::uint64_t resumed_at = 0;                               ///< observation; 0: the run began anew
  std::uint64_t commits = 0;                                  ///< of this run
  const char* poses = "";                                     ///< where they came from
  std::vector<std::string> warnings;
};

/// Observations of one sensory frame are one keyframe, "kf000000", "kf000001", ... with their stamps. A map
/// that an interrupted run left, of the same log with the same settings, is gone on with from its last
/// committed keyframe, and ends with the same tiles as an uninterrupted run. Memory is bounded by
/// create.max_memory_bytes, the reader's included, and by 300 bytes for each tile and submap.
/// Errors: those of survey_log, LogPoses, RawlogReader and MapUpdater; CannotWrite (the map exists and is
/// another one's or complete, and not `overwrite`); Empty (no observation has a pose). What was committed
/// stays.
[[nodiscard]] Result<LogMapReport> map_log(const LogMapRequest& request);

}  // namespace mapcodec
