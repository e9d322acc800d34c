// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/bag_poses.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kMostTransforms = std::uint64_t{1} << 24;

std::set<std::uint32_t> tf_connections(const BagFile& bag) {
  std::set<std::uint32_t> r = bag.of_type("tf2_msgs/TFMessage");
  r.merge(bag.of_type("tf/tfMessage"));
  return r;
}

Error too_many() {
  return make_error(ErrorCode::kLimitExceeded, "holds more than 16,777,216 transforms");
}

}  // namespace

bool has_poses(const BagFile& bag, BagOptions::Poses poses) {
  return poses == BagOptions::Poses::odometry ? !bag.of_type("nav_msgs/Odometry").empty()
                                              : !tf_connections(bag).empty();
}

Status BagPoses::read_tf(const BagFile& bag, const ByteStream& stream) {
  BagMessages messages(bag, stream, tf_connections(bag));
  BagMessage m;
  std::uint64_t broken = 0;
  for (;;) {
    MAPCODEC_ASSIGN(const bool more, messages.next(m));
    if (!more) break;
    MAPCODEC_ASSIGN(const std::vector<RosTransform> transforms, read_transforms(m.bytes, broken));
    const bool is_static = bag.connections.at(m.connection).topic.ends_with("tf_static");
    for (const RosTransform& t : transforms) tree_.add(t, is_static);
    if (tree_.size() > kMostTransforms) return too_many();
  }
  if (broken > 0)
    warnings_.push_back(std::to_string(broken) + " transforms of tf have no rotation and are left out");
  if (tree_.other_parents() > 0)
    warnings_.push_back(std::to_string(tree_.other_parents()) +
                        " transforms of tf name another parent than before and are left out");
  return {};
}

Status BagPoses::read_odometry_topic(const BagFile& bag, const ByteStream& stream) {
  const std::set<std::uint32_t> all = bag.of_type("nav_msgs/Odometry");
  const std::string topic = bag.connections.at(*all.begin()).topic;
  std::set<std::uint32_t> chosen;
  bool others = false;
  for (const std::uint32_t c : all) {
    if (bag.connections.at(c).topic == topic)
      chosen.insert(c);
    else
      others = true;
  }
  if (others) warnings_.push_back("of several topics of odometry " + topic + " is taken");
  BagMessages messages(bag, stream, chosen);
  BagMessage m;
  std::uint64_t broken = 0;
  for (;;) {
    MAPCODEC_ASSIGN(const bool more, messages.next(m));
    if (!more) break;
    MAPCODEC_ASSIGN(std::optional<RosTransform> t, read_odometry(m.bytes));
    if (!t) {
      ++broken;
      continue;
    }
    if (base_.empty()) {
      base_ = t->child.empty() ? "base_link" : t->child;
      tree_.forget(base_);
    }
    t->child = base_;
    tree_.add(*t, false);
    if (tree_.size() > kMostTransforms) return too_many();
  }
  if (broken > 0)
    warnings_.push_back(std::to_string(broken) + " messages of odometry hold no pose and are left out");
  return {};
}

Result<BagPoses> BagPoses::read(const BagFile& bag, const ByteStream& stream, const BagOptions& options,
                                BagOptions::Poses poses) {
  BagPoses r;
  r.fixed_ = options.frame;
  r.odometry_ = poses == BagOptions::Poses::odometry;
  if (!has_poses(bag, poses)) {
    return make_error(ErrorCode::kInvalidArgument, r.odometry_
                                                       ? "holds no nav_msgs/Odometry for --poses odometry"
                                                       : "holds no tf for --poses tf");
  }
  if (has_poses(bag, BagOptions::Poses::tf)) MAPCODEC_TRY(r.read_tf(bag, stream));
  if (r.odometry_) MAPCODEC_TRY(r.read_odometry_topic(bag, stream));
  r.tree_.sort();
  return r;
}

std::optional<ScanPose> BagPoses::at(const std::string& frame, std::int64_t time_ns) const {
  if (!odometry_) {
    if (!tree_.has(frame) && fixed_ != frame) return std::nullopt;
    return tree_.lookup(fixed_.empty() ? tree_.root_of(frame) : fixed_, frame, time_ns);
  }
  const std::string fixed = fixed_.empty() ? tree_.root_of(base_) : fixed_;
  // Where nothing says how the sensor is mounted, it is taken to stand where the odometry's frame stands.
  const bool mounted = tree_.root_of(frame) == tree_.root_of(base_);
  return tree_.lookup(fixed, mounted ? frame : base_, time_ns);
}

}  // namespace mapcodec
