// SPDX-License-Identifier: GPL-3.0-or-later
// The messages that a map is made from, out of ROS 1's serialisation: fields in order, little-endian, strings
// and arrays after their 32-bit counts. Only the storage library of ROS is in Debian's main archive without
// all of ROS, and these few are small.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "slam_adapter/formats/record_plan.hpp"
#include "slam_adapter/rosbag/scan_pose.hpp"

namespace mapcodec {

/// std_msgs/Header.
struct RosHeader {
  std::int64_t stamp_ns = 0;  ///< since epoch
  std::string frame;          ///< without the leading slash of tf's first version
};

/// T_parent_child at a time: geometry_msgs/TransformStamped, or what nav_msgs/Odometry says.
struct RosTransform {
  RosHeader header;  ///< its frame is the parent
  std::string child;
  ScanPose pose;
};

/// sensor_msgs/PointCloud2. Rows of `width` records; between rows may be bytes of padding.
struct RosCloud {
  RosHeader header;
  std::uint32_t width = 0, height = 0, point_step = 0, row_step = 0;
  bool big_endian = false;
  std::vector<RecordField> fields;
  ByteSpan data;  ///< view into the message; long enough for all rows
};

/// tf2_msgs/TFMessage and tf/tfMessage. Transforms with a rotation that is none are left out and counted in
/// `broken`. Errors of all: Truncated, Malformed. Threads: pure.
[[nodiscard]] Result<std::vector<RosTransform>> read_transforms(ByteSpan message, std::uint64_t& broken);
/// nav_msgs/Odometry: the pose of child_frame_id in its header's frame; nothing where it is no pose.
[[nodiscard]] Result<std::optional<RosTransform>> read_odometry(ByteSpan message);
/// Fields lie within the record, rows within the data.
[[nodiscard]] Result<RosCloud> read_cloud(ByteSpan message);

}  // namespace mapcodec
