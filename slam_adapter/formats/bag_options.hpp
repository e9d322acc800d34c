// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace mapcodec {

/// What of a ROS bag is read, and where it goes. Other formats ignore it.
struct BagOptions {
  /// automatic: tf where it knows a pose for the clouds, else odometry, else none.
  enum class Poses : std::uint8_t { automatic, tf, odometry, none };
  std::vector<std::string> topics;  ///< of sensor_msgs/PointCloud2; empty: all
  Poses poses = Poses::automatic;
  std::string frame;  ///< that becomes the map's; empty: the root of the tree in which the sensor hangs
};

}  // namespace mapcodec
