// SPDX-License-Identifier: GPL-3.0-or-later
// From a PointCloud2 to our points, and what clouds of several topics have in common.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/cloud/point_cloud.hpp"
#include "slam_adapter/rosbag/ros_messages.hpp"

namespace mapcodec {

/// The points of a message, rows one after the other, in its own frame; packed colour, normals and other
/// fields as in PCD. Errors: Malformed (no x, y, z), Unsupported (too many fields), LimitExceeded (more than
/// 2^26 points). Threads: pure.
[[nodiscard]] Result<PointCloud> decode_cloud(const RosCloud& message);
/// The same without points.
[[nodiscard]] Result<PointCloud> cloud_layout(const RosCloud& message);

/// The channels that all of `layouts` have, in the first one's order, f64 where coordinates differ.
/// @param names  of the layouts, for `warnings`, which says what is left out.
[[nodiscard]] PointCloud common_layout(const std::vector<PointCloud>& layouts,
                                       const std::vector<std::string>& names,
                                       std::vector<std::string>& warnings);
/// Brings `cloud` into `layout`; false if it lacks a channel or its coordinates would lose bits.
[[nodiscard]] bool conform(PointCloud& cloud, const PointCloud& layout);

}  // namespace mapcodec
