// SPDX-License-Identifier: GPL-3.0-or-later
// Which poses the observations of a log get, and where they come from.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "slam_adapter/mrpt/pose_track.hpp"
#include "slam_adapter/mrpt/rawlog_reader.hpp"

namespace mapcodec {

/// What a first look at a log finds, without its points.
struct LogSurvey {
  RawlogSummary summary;
  PointCloud layout;  ///< all channels that any observation has, as the widest type; f32 coordinates
  std::vector<std::string> missing;  ///< channels that not all observations have
  std::uint64_t frames = 0, file_bytes = 0;
  std::uint64_t planar_frames = 0, with_odometry = 0, with_pose = 0, without_stamp = 0;
  PoseTrack robot_poses;        ///< that the log itself states, where they have stamps
  bool moves = false;           ///< some pose is not the identity
  std::optional<Error> damage;  ///< that ended the look; what came before it counts
  /// Sentences: stamps that run backwards, or leave a gap of more than a minute.
  std::vector<std::string> jumps;
};
/// Errors: those of RawlogReader where nothing came before them; Empty (no observation with points, naming
/// what there is; no such sensor).
[[nodiscard]] Result<LogSurvey> survey_log(const std::string& path, const RawlogOptions& options);

enum class PoseSource { file, log, odometry, none };
[[nodiscard]] const char* pose_source_name(PoseSource source);

/// T_map_vehicle of one frame after another.
class LogPoses {
 public:
  /// Poses of a file of poses or a simplemap. Errors: those of read_pose_file and RawlogReader.
  [[nodiscard]] static Result<LogPoses> from_file(const std::string& path);
  /// Those that the log has: poses that it states, else odometry, else none (the identity).
  [[nodiscard]] static LogPoses best_of(const LogSurvey& survey);
  /// Of this kind alone. Errors: InvalidArgument (the log has none; what it has instead).
  [[nodiscard]] static Result<LogPoses> of(const LogSurvey& survey, PoseSource source);

  /// Frames must come in order. @return nothing where the source has no pose for it.
  [[nodiscard]] std::optional<MapPose> of(const RawlogFrame& frame);
  [[nodiscard]] PoseSource source() const { return source_; }
  /// Of the last frame among the groups of observations; where the next ones begin.
  [[nodiscard]] std::size_t place() const { return place_; }
  void begin_at(std::size_t place) { place_ = place; }

 private:
  PoseSource source_ = PoseSource::none;
  PoseTrack track_;
  std::optional<std::uint64_t> group_;  // of the last frame, for poses that have a place only
  std::size_t place_ = 0;
};

/// `frame.points` with exactly the channels of `layout`: types widened, what is missing as zeros.
[[nodiscard]] PointCloud with_layout(PointCloud points, const PointCloud& layout);

}  // namespace mapcodec
