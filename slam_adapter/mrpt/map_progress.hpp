// SPDX-License-Identifier: GPL-3.0-or-later
// How far a log has become a map, kept in the map itself: what an interrupted run goes on from.
#pragma once

#include <optional>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"
#include "slam_adapter/local_map.hpp"

namespace mapcodec {

/// Key in MapInfo::extras.
inline constexpr const char* kMapProgressExtra = "rawlog";

/// What a tracker knows of the vehicle after an observation.
struct TrackState {
  MapPose T_map_vehicle;
  MapPose step;                   ///< the motion before it, T_before_after
  std::optional<double> stamp_s;  ///< of the pose
  double step_s = 0;              ///< that the step took; 0: unknown
  std::optional<MapPose> T_odom_vehicle;
  double radius_m = 0;  ///< how far the map is looked at
};

struct MapProgress {
  std::uint64_t fingerprint = 0;  ///< of the log and of all settings that change the map
  std::uint64_t next = 0;         ///< number of the first observation that is not in the map
  std::uint64_t keyframes = 0;
  std::uint64_t place = 0;  ///< groups of observations before `next`, for poses that have a place only
  std::uint64_t frames = 0, without_pose = 0, thinned_out = 0, lost = 0;
  MapPose last_keyframe;
  std::optional<TrackState> track;
  bool complete = false;
};

/// Layout: version 1 (1 byte), then the fields in their order, integers as varints, numbers as f64, a byte
/// before each optional one.
[[nodiscard]] Bytes write_progress(const MapProgress& p);
/// Errors: Truncated, Unsupported (another version).
[[nodiscard]] Result<MapProgress> read_progress(ByteSpan bytes);

}  // namespace mapcodec
