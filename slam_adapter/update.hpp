// SPDX-License-Identifier: GPL-3.0-or-later
// Files into an existing map.
#pragma once

#include <string>
#include <vector>

#include "slam_adapter/compress.hpp"
#include "slam_adapter/map_updater.hpp"

namespace mapcodec {

struct UpdateRequest {
  std::vector<std::string> inputs;
  /// T_map_points; with a submap: that submap's pose from now on, and points stay in its frame.
  std::optional<PoseChange> pose;
  std::string submap;  ///< empty: the map's own points
  /// What the caller believes the map to promise; another promise is an error.
  std::optional<PromiseKind> promise;
  double promise_m = 0;
  std::optional<double> color_error;
  double unit_m = 1;  ///< metres per unit of the inputs
  BagOptions bag;     ///< of ROS bags among the inputs
  /// Inputs are ROS bags: each of their clouds becomes a submap TOPIC@STAMP at its pose, so that a later
  /// correction of poses moves it. Goes without `pose` and `submap`.
  bool each_scan = false;
  std::int64_t timestamp_s = 0;
  UpdateSettings settings;
  /// Given: a map that is not there is begun, with these (promise, colour, channels, tile size) and a layout
  /// that fits the first input.
  std::optional<CompressOptions> create;
};

/// Adds all points of the inputs to the map as one revision; the archive stays as it was if anything fails.
/// @param warnings  out: what was left out, one sentence each.
/// Errors: those of the sources and of MapUpdater; InvalidArgument (another promise).
[[nodiscard]] Result<UpdateReport> update_files(const std::string& map_path, const UpdateRequest& request,
                                                Arena& arena, std::vector<std::string>& warnings);

struct MergeRequest {
  std::vector<std::string> others;  ///< archives
  bool fuse = false;  ///< submaps of the others become points of the map instead of submaps of it
  std::int64_t timestamp_s = 0;
  UpdateSettings settings;
};
/// Adds the points of other archives as they decode: of plain ones by the rule of updates, of submaps as
/// submaps with their poses (a name that is taken gets the other file's before it). Octrees are laid over the
/// map's, which gets one if it has none; one of another resolution or kind is left out, with a warning,
/// unless the other holds nothing else. Errors as recorded are those to the decoded points of the others. One
/// revision; the archive stays as it was if anything fails.
/// Errors: those of MapUpdater and MapFile; Unsupported (an octree that was moved by a pose).
[[nodiscard]] Result<UpdateReport> merge_maps(const std::string& map_path, const MergeRequest& request,
                                              Arena& arena, std::vector<std::string>& warnings);

}  // namespace mapcodec
