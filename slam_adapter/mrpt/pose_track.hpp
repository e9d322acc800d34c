// SPDX-License-Identifier: GPL-3.0-or-later
// Where a robot was: poses over time, or one after the other, from files and from logs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "slam_adapter/local_map.hpp"

namespace mapcodec {

/// Poses of the vehicle. Threads: const methods from many at once.
class PoseTrack {
 public:
  /// @param stamp_s  must not fall; a pose at a stamp that is there replaces it.
  void add(double stamp_s, const MapPose& T_map_vehicle);
  /// A pose that has no stamp, only its place in the row.
  void add(const MapPose& T_map_vehicle);

  [[nodiscard]] bool empty() const { return poses_.empty(); }
  [[nodiscard]] std::size_t size() const { return poses_.size(); }
  [[nodiscard]] bool has_stamps() const { return !stamps_.empty(); }
  /// First and last stamp [s].
  [[nodiscard]] double first() const { return stamps_.front(); }
  [[nodiscard]] double last() const { return stamps_.back(); }

  /// At a time: between its neighbours if these are at most `gap_s` apart, or the nearer one if it is at most
  /// `near_s` away; else nothing.
  [[nodiscard]] std::optional<MapPose> at(double stamp_s, double gap_s = 2, double near_s = 0.05) const;
  /// The pose at this place of the row.
  [[nodiscard]] std::optional<MapPose> at_place(std::size_t place) const;

 private:
  std::vector<double> stamps_;
  std::vector<MapPose> poses_;
};

/// Reads a text file of poses, known by its columns; '#' and '%' begin comments:
/// - 8 "stamp x y z qx qy qz qw" (TUM), 7 "stamp x y z yaw pitch roll" (MRPT), 4 "stamp x y phi" (MRPT,
/// flat):
///   by time, unless the stamps are 0, 1, 2, ...;
/// - 12 numbers of a 3 x 4 matrix (KITTI), 6 "x y z yaw pitch roll" (MRPT), 3 "x y phi": one after the other.
/// Units: m, rad, s since epoch. Rows in any order of time. Errors, naming file and line: NotFound,
/// Unreadable, Empty, Malformed (columns that change, no number, a matrix or quaternion that turns nothing).
[[nodiscard]] Result<PoseTrack> read_pose_file(const std::string& path);
/// The same of text in memory; `name` stands in messages.
[[nodiscard]] Result<PoseTrack> read_pose_text(std::string_view text, const std::string& name);

}  // namespace mapcodec
