// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/bag_scans.hpp"

#include <algorithm>
#include <map>

#include "mapcodec/cloud/normals.hpp"
#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/rosbag/bag_poses.hpp"
#include "slam_adapter/rosbag/cloud_message.hpp"

namespace mapcodec {
namespace {

using Poses = BagOptions::Poses;
constexpr const char* kCloudType = "sensor_msgs/PointCloud2";

std::string list_topics(const BagFile& bag, const std::string& type) {
  std::set<std::string> names;
  for (const auto& [number, c] : bag.connections) {
    if (type.empty())
      names.insert(c.topic + " (" + c.type + ")");
    else if (c.type == type)
      names.insert(c.topic);
  }
  std::string r;
  std::size_t listed = 0;
  for (const std::string& name : names) {
    if (++listed > 20) return r + ", ...";
    r += (r.empty() ? "" : ", ") + name;
  }
  return r.empty() ? "nothing" : r;
}

std::int64_t stamp_of(const RosHeader& header, std::int64_t recorded_ns) {
  return header.stamp_ns != 0 ? header.stamp_ns : recorded_ns;
}

/// The error of a message, with the place of its chunk.
template <class T>
Result<T> in_chunk(Result<T> result, const BagMessages& messages) {
  if (result.ok() || result.error().offset) return result;
  return make_error(result.error().code, result.error().message, messages.chunk_offset());
}

class Scans final : public BagScans {
 public:
  Scans(std::unique_ptr<ByteStream> stream, BagFile bag) : stream_(std::move(stream)), bag_(std::move(bag)) {}

  Status prepare(const BagOptions& options) {
    MAPCODEC_TRY(choose_topics(options));
    MAPCODEC_TRY(find_layout());
    MAPCODEC_TRY(choose_poses(options));
    messages_ = std::make_unique<BagMessages>(bag_, *stream_, clouds_);
    return {};
  }

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] bool has_poses() const override { return poses_.has_value(); }

  Result<bool> next(BagScan& scan) override {
    BagMessage m;
    for (;;) {
      MAPCODEC_ASSIGN(const bool more, messages_->next(m));
      if (!more) return false;
      MAPCODEC_ASSIGN(const RosCloud cloud, in_chunk(read_cloud(m.bytes), *messages_));
      ++seen_;
      scan.topic = bag_.connections.at(m.connection).topic;
      scan.frame = cloud.header.frame;
      scan.stamp_ns = stamp_of(cloud.header, m.time_ns);
      scan.T_map_sensor = poses_ ? poses_->at(scan.frame, scan.stamp_ns) : std::nullopt;
      if (poses_ && !scan.T_map_sensor) {
        ++without_pose_;
        continue;
      }
      MAPCODEC_ASSIGN(scan.points, in_chunk(decode_cloud(cloud), *messages_));
      if (conform(scan.points, layout_)) return true;
      ++without_layout_;
    }
  }

  void rewind() override {
    messages_->rewind();
    seen_ = without_pose_ = without_layout_ = 0;
  }

  [[nodiscard]] std::vector<std::string> warnings() const override {
    std::vector<std::string> r = bag_.warnings;
    r.insert(r.end(), warnings_.begin(), warnings_.end());
    if (poses_) r.insert(r.end(), poses_->warnings().begin(), poses_->warnings().end());
    if (const auto name = unturned_normals(layout_); name && poses_)
      r.push_back("the channel " + *name +
                  " stays as it is: only \"normal\" of three floats or doubles turns with the poses");
    const std::string of = " of " + std::to_string(seen_) + " clouds ";
    if (without_pose_ > 0)
      r.push_back(std::to_string(without_pose_) + of + "have no pose at their time and are left out");
    if (without_layout_ > 0)
      r.push_back(std::to_string(without_layout_) + of +
                  "have other fields than the first of their topic and are left out");
    return r;
  }

 private:
  Status choose_topics(const BagOptions& options) {
    clouds_ = bag_.of_type(kCloudType);
    if (clouds_.empty())
      return make_error(ErrorCode::kEmpty,
                        std::string("holds no ") + kCloudType + "; it has " + list_topics(bag_, ""));
    for (const std::string& topic : options.topics) {
      const bool there = std::any_of(clouds_.begin(), clouds_.end(),
                                     [&](std::uint32_t c) { return bag_.connections.at(c).topic == topic; });
      if (!there)
        return make_error(
            ErrorCode::kInvalidArgument,
            "has no clouds on the topic " + topic + "; it has them on " + list_topics(bag_, kCloudType));
    }
    if (options.topics.empty()) return {};
    std::erase_if(clouds_, [&](std::uint32_t c) {
      return std::find(options.topics.begin(), options.topics.end(), bag_.connections.at(c).topic) ==
             options.topics.end();
    });
    return {};
  }

  /// The first message of each connection tells its layout.
  Status find_layout() {
    std::map<std::uint32_t, PointCloud> found;
    BagMessages messages(bag_, *stream_, clouds_);
    BagMessage m;
    while (found.size() < clouds_.size()) {
      MAPCODEC_ASSIGN(const bool more, messages.next(m));
      if (!more) break;
      if (found.count(m.connection) > 0) continue;
      MAPCODEC_ASSIGN(const RosCloud cloud, in_chunk(read_cloud(m.bytes), messages));
      MAPCODEC_ASSIGN(found[m.connection], in_chunk(cloud_layout(cloud), messages));
    }
    if (found.empty()) return make_error(ErrorCode::kEmpty, std::string("holds no message of ") + kCloudType);
    std::vector<PointCloud> layouts;
    std::vector<std::string> names;
    for (auto& [number, layout] : found) {
      layouts.push_back(std::move(layout));
      names.push_back(bag_.connections.at(number).topic);
    }
    layout_ = common_layout(layouts, names, warnings_);
    return {};
  }

  Status choose_poses(const BagOptions& options) {
    if (options.poses == Poses::none) return {};
    if (options.poses != Poses::automatic) {
      MAPCODEC_ASSIGN(poses_, BagPoses::read(bag_, *stream_, options, options.poses));
      MAPCODEC_ASSIGN(const bool any, any_pose());
      if (any) return {};
      return make_error(
          ErrorCode::kEmpty,
          "holds no cloud whose pose is known at its time; --poses none takes them as they lie");
    }
    for (const Poses p : {Poses::tf, Poses::odometry}) {
      if (!mapcodec::has_poses(bag_, p)) continue;
      MAPCODEC_ASSIGN(poses_, BagPoses::read(bag_, *stream_, options, p));
      MAPCODEC_ASSIGN(const bool any, any_pose());
      if (any) return {};
    }
    poses_.reset();
    if (!options.frame.empty())
      return make_error(ErrorCode::kEmpty,
                        "holds no cloud whose pose in the frame " + options.frame + " is known at its time");
    warnings_.emplace_back(
        "neither tf nor odometry knows the sensor's pose: all clouds are taken as they lie, in their own "
        "frames");
    return {};
  }

  Result<bool> any_pose() {
    BagMessages messages(bag_, *stream_, clouds_);
    BagMessage m;
    for (;;) {
      MAPCODEC_ASSIGN(const bool more, messages.next(m));
      if (!more) return false;
      MAPCODEC_ASSIGN(const RosCloud cloud, in_chunk(read_cloud(m.bytes), messages));
      if (poses_->at(cloud.header.frame, stamp_of(cloud.header, m.time_ns))) return true;
    }
  }

  std::unique_ptr<ByteStream> stream_;
  BagFile bag_;
  std::set<std::uint32_t> clouds_;
  PointCloud layout_;
  std::optional<BagPoses> poses_;
  std::unique_ptr<BagMessages> messages_;
  std::vector<std::string> warnings_;
  std::uint64_t seen_ = 0, without_pose_ = 0, without_layout_ = 0;
};

}  // namespace

Result<std::unique_ptr<BagScans>> BagScans::open(std::unique_ptr<ByteStream> stream,
                                                 const BagOptions& options) {
  MAPCODEC_ASSIGN(BagFile bag, BagFile::open(*stream));
  auto scans = std::make_unique<Scans>(std::move(stream), std::move(bag));
  MAPCODEC_TRY(scans->prepare(options));
  return std::unique_ptr<BagScans>(std::move(scans));
}

Result<std::unique_ptr<BagScans>> BagScans::open(const std::string& path, const BagOptions& options) {
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  auto scans = open(std::move(stream).value(), options);
  if (!scans.ok()) return named(path, scans.error());
  return scans;
}

}  // namespace mapcodec
