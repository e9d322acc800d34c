// SPDX-License-Identifier: GPL-3.0-or-later
// Where frames stood at a time: what tf's listener would know, for a whole recording at once.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "slam_adapter/rosbag/ros_messages.hpp"

namespace mapcodec {

class FrameTree {
 public:
  /// A frame has one parent, the first that was heard of; what names another is left out and counted.
  void add(const RosTransform& transform, bool is_static);
  /// Replaces what is known of the child's motion: for odometry, which may contradict tf.
  void forget(const std::string& child) { edges_.erase(child); }
  /// To be called once after the last `add`.
  void sort();

  [[nodiscard]] bool has(const std::string& child) const { return edges_.count(child) > 0; }
  /// The frame at the top of the tree that `frame` hangs in; itself if it has no parent.
  [[nodiscard]] std::string root_of(const std::string& frame) const;
  /// T_fixed_frame at a time, rotations and positions interpolated between the neighbours in time. Nothing
  /// where the frames are not connected, or where the time lies more than 0.1 s outside what was recorded.
  [[nodiscard]] std::optional<ScanPose> lookup(const std::string& fixed, const std::string& frame,
                                               std::int64_t time_ns) const;
  [[nodiscard]] std::uint64_t other_parents() const { return other_parents_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }

 private:
  struct Sample {
    std::int64_t time_ns = 0;
    ScanPose pose;
  };
  struct Edge {
    std::string parent;
    bool is_static = false;
    std::vector<Sample> samples;
  };
  [[nodiscard]] static std::optional<ScanPose> at(const Edge& edge, std::int64_t time_ns);
  /// T_root_frame.
  [[nodiscard]] std::optional<ScanPose> from_root(std::string frame, std::int64_t time_ns) const;

  std::map<std::string, Edge> edges_;  ///< by child
  std::uint64_t other_parents_ = 0, size_ = 0;
};

}  // namespace mapcodec
