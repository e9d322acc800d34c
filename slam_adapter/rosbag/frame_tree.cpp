// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/frame_tree.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

constexpr int kDeepest = 100;  ///< a chain that is longer is a loop
constexpr std::int64_t kSlackNs = 100'000'000;

}  // namespace

void FrameTree::add(const RosTransform& t, bool is_static) {
  Edge& edge = edges_[t.child];
  if (edge.samples.empty()) {
    edge.parent = t.header.frame;
    edge.is_static = is_static;
  }
  if (edge.parent != t.header.frame || edge.is_static != is_static) {
    ++other_parents_;
    return;
  }
  if (is_static) edge.samples.clear();  // the last word counts
  edge.samples.push_back({t.header.stamp_ns, t.pose});
  ++size_;
}

void FrameTree::sort() {
  for (auto& [child, edge] : edges_) {
    std::stable_sort(edge.samples.begin(), edge.samples.end(),
                     [](const Sample& a, const Sample& b) { return a.time_ns < b.time_ns; });
  }
}

std::string FrameTree::root_of(const std::string& frame) const {
  std::string r = frame;
  for (int i = 0; i < kDeepest; ++i) {
    const auto it = edges_.find(r);
    if (it == edges_.end()) return r;
    r = it->second.parent;
  }
  return r;
}

std::optional<ScanPose> FrameTree::at(const Edge& edge, std::int64_t time_ns) {
  const std::vector<Sample>& s = edge.samples;
  if (edge.is_static) return s.front().pose;
  const auto after = std::lower_bound(s.begin(), s.end(), time_ns,
                                      [](const Sample& a, std::int64_t t) { return a.time_ns < t; });
  if (after == s.end())
    return time_ns - s.back().time_ns <= kSlackNs ? std::optional(s.back().pose) : std::nullopt;
  if (after->time_ns == time_ns) return after->pose;
  if (after == s.begin())
    return after->time_ns - time_ns <= kSlackNs ? std::optional(after->pose) : std::nullopt;
  const Sample &a = *(after - 1), &b = *after;
  return interpolate(a.pose, b.pose,
                     static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns));
}

std::optional<ScanPose> FrameTree::from_root(std::string frame, std::int64_t time_ns) const {
  ScanPose r;
  for (int i = 0; i < kDeepest; ++i) {
    const auto it = edges_.find(frame);
    if (it == edges_.end()) return r;
    const auto step = at(it->second, time_ns);
    if (!step) return std::nullopt;
    r = *step * r;
    frame = it->second.parent;
  }
  return std::nullopt;
}

std::optional<ScanPose> FrameTree::lookup(const std::string& fixed, const std::string& frame,
                                          std::int64_t time_ns) const {
  if (fixed == frame) return ScanPose{};
  if (root_of(fixed) != root_of(frame)) return std::nullopt;
  const auto to_fixed = from_root(fixed, time_ns), to_frame = from_root(frame, time_ns);
  if (!to_fixed || !to_frame) return std::nullopt;
  return has(fixed) ? to_fixed->inverse() * *to_frame : *to_frame;
}

}  // namespace mapcodec
