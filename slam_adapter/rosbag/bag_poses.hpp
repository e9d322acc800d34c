// SPDX-License-Identifier: GPL-3.0-or-later
// Where a bag's sensors stood.
#pragma once

#include <memory>

#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/rosbag/bag_file.hpp"
#include "slam_adapter/rosbag/frame_tree.hpp"

namespace mapcodec {

/// The poses that a bag has recorded, from tf or from odometry.
class BagPoses {
 public:
  /// Reads what the bag says of poses. @param poses  tf or odometry.
  /// Errors: InvalidArgument (the bag has no such messages), LimitExceeded (more than 2^24 of them), those of
  /// the messages.
  [[nodiscard]] static Result<BagPoses> read(const BagFile& bag, const ByteStream& stream,
                                             const BagOptions& options, BagOptions::Poses poses);
  /// T_map_sensor; nothing where it is not known.
  [[nodiscard]] std::optional<ScanPose> at(const std::string& frame, std::int64_t time_ns) const;
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  [[nodiscard]] Status read_tf(const BagFile& bag, const ByteStream& stream);
  [[nodiscard]] Status read_odometry_topic(const BagFile& bag, const ByteStream& stream);

  FrameTree tree_;
  std::string fixed_;  ///< as asked for; empty: the root
  std::string base_;   ///< whose pose odometry tells
  bool odometry_ = false;
  std::vector<std::string> warnings_;
};

/// Whether the bag has messages of the kind at all.
[[nodiscard]] bool has_poses(const BagFile& bag, BagOptions::Poses poses);

}  // namespace mapcodec
