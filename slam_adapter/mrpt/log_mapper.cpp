// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/log_mapper.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "mapcodec/base/crc32c.hpp"
#include "mapcodec/cloud/cloud_source.hpp"
#include "slam_adapter/create_map.hpp"
#include "slam_adapter/formats/byte_stream.hpp"
#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/mrpt/log_tracker.hpp"
#include "slam_adapter/mrpt/map_progress.hpp"
#include "slam_adapter/mrpt/pose_math.hpp"

namespace mapcodec {
namespace {

using Poses = LogMapRequest::Poses;

/// A commit is due when this share of what is committed has come since: the table of submaps, which each
/// commit writes, then costs no more than a fixed multiple of itself.
constexpr std::uint64_t kCommitShare = 32;
constexpr std::uint64_t kBytesPerHeldPoint = 1024;  // of the budget; a point takes that while it is coded
constexpr std::uint64_t kLeastReader = std::uint64_t{3} << 29;

struct Budget {
  std::uint64_t reader, cache, local, batch_points;
};
/// Shares of the memory for the reader (address space: about 1 GB of it is never touched), the updater, the
/// local map.
Budget budget_of(std::uint64_t bytes) {
  if (bytes == 0) bytes = std::uint64_t{4} << 30;
  return {std::max(kLeastReader, kLeastReader + bytes / 4), bytes / 16, bytes / 8,
          std::clamp<std::uint64_t>(bytes / kBytesPerHeldPoint, 1 << 16, 1 << 21)};
}

std::string keyframe_name(std::uint64_t number) {
  char name[32];
  std::snprintf(name, sizeof name, "kf%06llu", static_cast<unsigned long long>(number));
  return name;
}

/// Observations that were made at one time and place.
struct Group {
  std::vector<RawlogFrame> frames;
  [[nodiscard]] const RawlogFrame& first() const { return frames.front(); }
  [[nodiscard]] bool planar() const {
    return std::all_of(frames.begin(), frames.end(), [](const RawlogFrame& f) { return f.planar; });
  }
};

/// Everything that changes the map but the log's own bytes beyond its first and last 64 KiB.
Result<std::uint64_t> fingerprint_of(const LogMapRequest& r) {
  MAPCODEC_ASSIGN(const std::unique_ptr<ByteStream> stream, file_stream(r.log));
  Bytes block(1 << 16);
  MAPCODEC_ASSIGN(std::size_t got, stream->read_at(0, block.data(), block.size()));
  std::uint32_t crc = crc32c(ByteSpan(block).first(got));
  const std::uint64_t tail = stream->size() > block.size() ? stream->size() - block.size() : 0;
  MAPCODEC_ASSIGN(got, stream->read_at(tail, block.data(), block.size()));
  crc = crc32c(ByteSpan(block).first(got), crc);
  ByteWriter out;
  out.u64(stream->size());
  for (const std::string& s : r.read.sensors) out.text(s);
  out.u8(r.read.decimation);
  out.u8(static_cast<std::uint8_t>(r.poses));
  out.text(r.pose_file);
  for (const double v :
       {r.keyframe_m, r.keyframe_rad, r.create.promise_m, r.create.color_error, r.create.tile_size_m})
    out.f64(v);
  out.u8(static_cast<std::uint8_t>(r.create.promise));
  for (const std::string& c : r.create.channels) out.text(c);
  out.u8(r.pending ? 1 : 0);
  const std::uint32_t settings = crc32c(out.bytes());
  return (std::uint64_t{crc} << 32) | settings;
}

class LogMapper {
 public:
  LogMapper(const LogMapRequest& request, LogMapReport& report)
      : r_(request),
        report_(report),
        arena_(request.create.threads),
        budget_(budget_of(request.create.max_memory_bytes)) {}

  Status run() {
    MAPCODEC_ASSIGN(progress_.fingerprint, fingerprint_of(r_));
    MAPCODEC_TRY(go_on_if_begun());
    RawlogOptions read = r_.read;
    read.memory_bytes = budget_.reader;
    MAPCODEC_ASSIGN(survey_, survey_log(r_.log, read));
    MAPCODEC_TRY(choose_poses());
    read.skip = progress_.next;
    read.match_scans = match_scans_;
    MAPCODEC_ASSIGN(RawlogReader reader, RawlogReader::open(r_.log, read));
    const Status done = read_all(reader);
    say_what_was_left();
    return done;
  }

 private:
  /// Opens the map that an interrupted run left.
  Status go_on_if_begun() {
    std::error_code ignored;
    if (!std::filesystem::exists(r_.map, ignored) || r_.create.overwrite) return {};
    MAPCODEC_ASSIGN(const MapFile file, MapFile::open(r_.map));
    const auto& extras = file.archive().info().extras;
    const auto extra = extras.find(kMapProgressExtra);
    const auto refuse = [&](const char* why) {
      return make_error(ErrorCode::kCannotWrite, r_.map + ": " + why + " (--force replaces it)");
    };
    if (extra == extras.end()) return refuse("exists already, and was not made of a log");
    auto begun = read_progress(extra->second);
    if (!begun.ok()) return refuse("exists already, and how far it is cannot be read");
    if (begun->fingerprint != progress_.fingerprint)
      return refuse("exists already, of another log or with other settings");
    if (begun->complete) return refuse("is complete already");
    progress_ = *begun;
    committed_ = progress_.keyframes;
    report_.resumed_at = progress_.next;
    report_.warnings.push_back("goes on at observation " + std::to_string(progress_.next) + ", after " +
                               std::to_string(progress_.keyframes) +
                               " keyframes that an earlier run committed");
    MAPCODEC_ASSIGN(MapUpdater map, MapUpdater::open(r_.map, arena_, settings()));
    map_.emplace(std::move(map));
    return {};
  }

  UpdateSettings settings() const {
    UpdateSettings s;
    s.for_good = !r_.pending;
    s.cache_bytes = budget_.cache;
    s.batch_points = budget_.batch_points;
    s.density_cap = false;  // no two keyframes share a tile
    s.stop = r_.create.stop;
    return s;
  }

  Status choose_poses() {
    report_.poses = "icp";
    if (r_.poses == Poses::icp) {
      match_scans_ = 2 * survey_.planar_frames > survey_.frames;
      if (match_scans_) {
        poses_ = LogPoses::best_of(LogSurvey{});
        return {};
      }
      if (!r_.registrar)
        return make_error(ErrorCode::kUnsupported, "this build has no registration of 3D scans");
      tracker_.emplace(r_.map, r_.registrar, budget_.local, arena_);
      tracker_->set_state(progress_.track);
      return {};
    }
    if (r_.poses == Poses::file) {
      MAPCODEC_ASSIGN(poses_, LogPoses::from_file(r_.pose_file));
    } else if (r_.poses == Poses::best) {
      poses_ = LogPoses::best_of(survey_);
      if (poses_->source() == PoseSource::none)
        return named(r_.log,
                     make_error(ErrorCode::kEmpty, "holds no poses: give a file of poses, or --poses icp"));
    } else {
      auto poses = LogPoses::of(survey_, r_.poses == Poses::log ? PoseSource::log : PoseSource::odometry);
      if (!poses.ok()) return named(r_.log, make_error(ErrorCode::kEmpty, poses.error().message));
      poses_ = std::move(*poses);
    }
    poses_->begin_at(progress_.place);
    report_.poses = pose_source_name(poses_->source());
    return {};
  }

  Status read_all(RawlogReader& reader) {
    Group group;
    for (;;) {
      MAPCODEC_TRY(stopped());
      auto frame = reader.next();
      if (!frame.ok()) return keep_what_is_whole(group, frame.error());
      if (*frame && (group.frames.empty() || group.first().group == (*frame)->group)) {
        group.frames.push_back(std::move(**frame));
        continue;
      }
      if (!group.frames.empty()) MAPCODEC_TRY(take(group));
      group.frames.clear();
      if (!*frame) break;
      group.frames.push_back(std::move(**frame));
    }
    return finish();
  }

  /// A log that is damaged further on: what came before it stays in the map.
  Status keep_what_is_whole(Group& group, const Error& error) {
    if (!group.frames.empty()) MAPCODEC_TRY(take(group));
    if (map_) MAPCODEC_TRY(commit());
    if (progress_.keyframes == 0) return error;
    return make_error(error.code,
                      error.message + "; the " + std::to_string(progress_.keyframes) +
                          " keyframes before it are in the map",
                      error.offset);
  }

  Status stopped() const {
    if (r_.create.stop == nullptr || !*r_.create.stop) return {};
    return make_error(ErrorCode::kCancelled, "stopped after " + std::to_string(committed_) +
                                                 " committed keyframes; the same command goes on from there");
  }

  Status take(Group& group) {
    PointCloud points = survey_.layout.like();
    for (RawlogFrame& f : group.frames) points.append(with_layout(std::move(f.points), survey_.layout));
    progress_.frames += group.frames.size();
    MAPCODEC_ASSIGN(const auto pose, pose_of_group(group, points));
    if (pose && is_keyframe(*pose)) {
      MAPCODEC_TRY(add(group, std::move(points), *pose));
      progress_.last_keyframe = *pose;
    } else if (pose) {
      progress_.thinned_out += group.frames.size();
    }
    progress_.next = group.frames.back().number + 1;
    if (poses_) progress_.place = poses_->place() + 1;
    if (tracker_) progress_.track = tracker_->state();
    if (map_ && due()) MAPCODEC_TRY(commit());
    if (r_.create.progress)
      r_.create.progress({"rawlog", group.first().file_offset, survey_.file_bytes, report_.points});
    return {};
  }

  Result<std::optional<MapPose>> pose_of_group(const Group& group, const PointCloud& points) {
    std::optional<MapPose> pose;
    if (tracker_) {
      MAPCODEC_ASSIGN(pose, tracker_->track(group.first(), points));
      if (!pose) progress_.lost += group.frames.size();
    } else {
      pose = match_scans_ ? group.first().T_map_vehicle : poses_->of(group.first());
      if (!pose) progress_.without_pose += group.frames.size();
    }
    return pose;
  }

  bool is_keyframe(const MapPose& pose) const {
    if (progress_.keyframes == 0 || (r_.keyframe_m <= 0 && r_.keyframe_rad <= 0)) return true;
    const MapPose moved = between(progress_.last_keyframe, pose);
    return (r_.keyframe_m > 0 && length_of(moved.translation_m) >= r_.keyframe_m) ||
           (r_.keyframe_rad > 0 && angle_of(moved.rotation_xyzw) >= r_.keyframe_rad);
  }

  Status add(const Group& group, PointCloud points, const MapPose& pose) {
    if (!map_) MAPCODEC_TRY(begin_map(points));
    const PoseChange at{0, pose.translation_m, pose.rotation_xyzw};
    MAPCODEC_ASSIGN(const std::uint32_t submap, map_->submap(keyframe_name(progress_.keyframes), at));
    const double first = group.first().stamp_s.value_or(0),
                 last = group.frames.back().stamp_s.value_or(first);
    MAPCODEC_TRY(map_->set_stamps(submap, first, last));
    report_.points += points.size();
    MAPCODEC_TRY(map_->insert(std::move(points), submap));
    ++progress_.keyframes;
    return {};
  }

  Status begin_map(const PointCloud& first) {
    CompressOptions options = r_.create;
    CloudSource source(first);
    auto map = create_map(r_.map, source, options, arena_, settings(), report_.warnings);
    if (!map.ok()) return named(map.error().code == ErrorCode::kCannotWrite ? r_.map : r_.log, map.error());
    map_.emplace(std::move(*map));
    return {};
  }

  [[nodiscard]] bool due() const {
    // Registration looks for the newest keyframe in the map.
    const std::uint64_t share = tracker_ ? 1 : std::max<std::uint64_t>(1, committed_ / kCommitShare);
    return progress_.keyframes - committed_ >= share;
  }

  Status commit() {
    map_->set_extra(kMapProgressExtra, write_progress(progress_), true);
    if (const auto done = map_->commit(r_.timestamp_s); !done.ok()) return done.error();
    ++report_.commits;
    committed_ = progress_.keyframes;
    return {};
  }

  Status finish() {
    if (!map_)
      return named(r_.log, make_error(ErrorCode::kEmpty, "none of its " + std::to_string(progress_.frames) +
                                                             " observations has a pose: do the stamps fit?"));
    map_->add_input_bytes(survey_.file_bytes);
    progress_.complete = true;
    return commit();
  }

  void say_what_was_left() {
    report_.keyframes = progress_.keyframes;
    report_.frames = progress_.frames;
    report_.without_pose = progress_.without_pose;
    report_.thinned_out = progress_.thinned_out;
    report_.lost = progress_.lost;
    const auto say = [&](std::uint64_t count, const char* what) {
      if (count > 0) report_.warnings.push_back(std::to_string(count) + what);
    };
    for (const std::string& s : survey_.jumps) report_.warnings.push_back(s);
    for (const std::string& s : unused_classes(survey_.summary)) report_.warnings.push_back(s);
    for (const std::string& s : survey_.missing)
      report_.warnings.push_back("some observations have no " + s + ": it is zero there");
    say(progress_.without_pose,
        " observations have no pose (their stamps are not within those of the poses): left out");
    say(progress_.lost, " observations could not be registered: left out");
    say(progress_.thinned_out,
        " observations are no keyframes (--keyframe-distance, --keyframe-angle): left out");
  }

  const LogMapRequest& r_;
  LogMapReport& report_;
  Arena arena_;
  Budget budget_;
  MapProgress progress_;
  LogSurvey survey_;
  std::optional<LogPoses> poses_;
  std::optional<LogTracker> tracker_;
  std::optional<MapUpdater> map_;
  bool match_scans_ = false;
  std::uint64_t committed_ = 0;
};

}  // namespace

Result<LogMapReport> map_log(const LogMapRequest& request) {
  LogMapReport report;
  LogMapper mapper(request, report);
  MAPCODEC_TRY(mapper.run());
  return report;
}

}  // namespace mapcodec
