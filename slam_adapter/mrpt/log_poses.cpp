// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/log_poses.hpp"

#include <algorithm>
#include <cmath>

#include "slam_adapter/formats/detect.hpp"
#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/mrpt/pose_math.hpp"

namespace mapcodec {
namespace {

constexpr double kBackwards = 1, kLongGap = 60;  // [s] that a user should hear of
constexpr std::size_t kMostJumps = 10;
constexpr const char* kRobotPose = "CObservationRobotPose";

/// A type that holds the values of both, as near as float32 where that is what they are.
ScalarType wider(ScalarType a, ScalarType b) {
  if (a == b) return a;
  const auto is_large = [](ScalarType t) { return t != ScalarType::f32 && scalar_size(t) >= 4; };
  return is_large(a) || is_large(b) ? ScalarType::f64 : ScalarType::f32;
}

void join_layout(PointCloud& all, const PointCloud& one) {
  for (const Channel& c : one.channels) {
    Channel* known = all.find(c.info.name);
    if (known == nullptr) {
      all.channels.push_back({c.info, {}});
    } else if (known->info.components == c.info.components) {
      known->info.scalar = wider(known->info.scalar, c.info.scalar);
    }
  }
}

std::string seconds_text(double s) {
  std::string text = std::to_string(s);
  return text.substr(0, text.find('.') + 4);
}

class Surveyor {
 public:
  explicit Surveyor(LogSurvey& s) : s_(s) {}

  void take(const RawlogFrame& f) {
    if (f.class_name == kRobotPose) {
      if (f.stamp_s && f.T_map_vehicle && (s_.robot_poses.empty() || *f.stamp_s >= s_.robot_poses.last()))
        s_.robot_poses.add(*f.stamp_s, *f.T_map_vehicle);
      return;
    }
    ++s_.frames;
    s_.planar_frames += f.planar;
    s_.with_odometry += f.T_odom_vehicle.has_value();
    s_.with_pose += f.T_map_vehicle.has_value();
    for (const auto& pose : {f.T_odom_vehicle, f.T_map_vehicle}) {
      if (pose && (length_of(pose->translation_m) > 0 || angle_of(pose->rotation_xyzw) > 0)) s_.moves = true;
    }
    look_at_time(f);
    join_layout(s_.layout, f.points);
    layouts_.push_back({});
    for (const Channel& c : f.points.channels) layouts_.back().push_back(c.info.name);
    if (layouts_.size() > 1 && layouts_.back() == layouts_[layouts_.size() - 2]) layouts_.pop_back();
  }

  void finish() {
    for (const Channel& c : s_.layout.channels) {
      const bool in_all = std::all_of(layouts_.begin(), layouts_.end(), [&](const auto& names) {
        return std::find(names.begin(), names.end(), c.info.name) != names.end();
      });
      if (!in_all) s_.missing.push_back(c.info.name);
    }
  }

 private:
  void look_at_time(const RawlogFrame& f) {
    if (!f.stamp_s) {
      ++s_.without_stamp;
      return;
    }
    if (last_) {
      const double step = *f.stamp_s - *last_;
      if ((step < -kBackwards || step > kLongGap) && s_.jumps.size() < kMostJumps)
        s_.jumps.push_back("time jumps by " + seconds_text(step) + " s at observation " +
                           std::to_string(f.number));
    }
    last_ = f.stamp_s;
  }

  LogSurvey& s_;
  std::optional<double> last_;
  std::vector<std::vector<std::string>> layouts_;
};

std::string whats_there(const RawlogSummary& summary) {
  std::string all;
  for (const RawlogClass& c : summary.classes) {
    all += (all.empty() ? "" : ", ") + std::to_string(c.count) + " " + c.name +
           (c.remark.empty() ? "" : " (" + c.remark + ")");
    if (all.size() > 500) return all + ", ...";
  }
  return all.empty() ? "nothing at all" : all;
}

Result<LogPoses*> nothing_of(const LogSurvey& s, const char* what) {
  const std::string instead = s.with_pose > 0       ? "it states poses itself (--poses log)"
                              : s.with_odometry > 0 ? "it has odometry (--poses odometry)"
                                                    : "give a file of poses, or --poses icp";
  return make_error(ErrorCode::kInvalidArgument, std::string("the log has no ") + what + ": " + instead);
}

}  // namespace

Result<LogSurvey> survey_log(const std::string& path, const RawlogOptions& options) {
  RawlogOptions list = options;
  list.list = true;
  list.skip = 0;
  list.match_scans = false;
  MAPCODEC_ASSIGN(RawlogReader reader, RawlogReader::open(path, list));
  LogSurvey s;
  s.file_bytes = reader.file_bytes();
  Surveyor surveyor(s);
  for (;;) {
    const auto frame = reader.next();
    if (!frame.ok() && s.frames == 0) return frame.error();
    if (!frame.ok()) s.damage = frame.error();
    if (!frame.ok() || !*frame) break;
    surveyor.take(**frame);
  }
  surveyor.finish();
  s.summary = reader.summary();
  if (s.frames == 0)
    return named(path, make_error(ErrorCode::kEmpty,
                                  "holds no observation with points; there is " + whats_there(s.summary)));
  return s;
}

const char* pose_source_name(PoseSource source) {
  constexpr const char* kNames[] = {"file", "log", "odometry", "none"};
  return kNames[static_cast<std::size_t>(source)];
}

Result<LogPoses> LogPoses::from_file(const std::string& path) {
  LogPoses poses;
  poses.source_ = PoseSource::file;
  MAPCODEC_ASSIGN(const std::string format, detect_format(path));
  if (format != format_info(Format::simplemap).name) {
    MAPCODEC_ASSIGN(poses.track_, read_pose_file(path));
    return poses;
  }
  MAPCODEC_ASSIGN(const LogSurvey survey, survey_log(path, {}));
  RawlogOptions list;
  list.list = true;
  MAPCODEC_ASSIGN(RawlogReader reader, RawlogReader::open(path, list));
  std::vector<std::pair<double, MapPose>> stamped;
  std::optional<std::uint64_t> group;
  for (;;) {
    MAPCODEC_ASSIGN(const auto frame, reader.next());
    if (!frame) break;
    if (!frame->T_map_vehicle) continue;
    if (survey.without_stamp == 0) {
      stamped.emplace_back(*frame->stamp_s, *frame->T_map_vehicle);
    } else if (group != frame->group) {
      poses.track_.add(*frame->T_map_vehicle);
    }
    group = frame->group;
  }
  std::stable_sort(stamped.begin(), stamped.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [stamp, pose] : stamped) poses.track_.add(stamp, pose);
  return poses;
}

LogPoses LogPoses::best_of(const LogSurvey& survey) {
  LogPoses poses;
  if (survey.with_pose > 0) {
    poses.source_ = PoseSource::log;
    poses.track_ = survey.robot_poses;
  } else if (survey.with_odometry > 0) {
    poses.source_ = PoseSource::odometry;
  }
  return poses;
}

Result<LogPoses> LogPoses::of(const LogSurvey& survey, PoseSource source) {
  LogPoses poses = best_of(survey);
  if (source == PoseSource::log && survey.with_pose == 0)
    return nothing_of(survey, "poses of its own").error();
  if (source == PoseSource::odometry && survey.with_odometry == 0)
    return nothing_of(survey, "odometry").error();
  poses.source_ = source;
  return poses;
}

std::optional<MapPose> LogPoses::of(const RawlogFrame& frame) {
  if (source_ == PoseSource::odometry) return frame.T_odom_vehicle;
  if (source_ == PoseSource::none) return MapPose{};
  if (source_ == PoseSource::log) {
    const auto between = frame.stamp_s && track_.has_stamps() ? track_.at(*frame.stamp_s) : std::nullopt;
    return between ? between : frame.T_map_vehicle;
  }
  if (track_.has_stamps()) return frame.stamp_s ? track_.at(*frame.stamp_s) : std::nullopt;
  if (group_ && *group_ != frame.group) ++place_;
  group_ = frame.group;
  return track_.at_place(place_);
}

PointCloud with_layout(PointCloud points, const PointCloud& layout) {
  std::vector<Channel> channels;
  for (const Channel& wanted : layout.channels) {
    Channel to{wanted.info, Bytes(wanted.info.stride() * points.size())};
    Channel* from = points.find(wanted.info.name);
    if (from != nullptr && from->info == wanted.info) {
      to.data = std::move(from->data);
    } else if (from != nullptr && from->info.components == to.info.components) {
      for (std::size_t i = 0; i < points.size() * to.info.components; ++i) {
        const double v = visit_scalar(
            from->info.scalar, [&](auto t) { return static_cast<double>(from->get<decltype(t)>(0, i)); });
        visit_scalar(to.info.scalar, [&](auto t) { to.set(0, static_cast<decltype(t)>(v), i); });
      }
    }
    channels.push_back(std::move(to));
  }
  points.channels = std::move(channels);
  return points;
}

}  // namespace mapcodec
