// SPDX-License-Identifier: GPL-3.0-or-later
// rawlog: a log of MRPT's becomes a map, keyframe after keyframe.
#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <numbers>

#include "maps/compaction.hpp"
#include "slam_adapter/formats/file_sink.hpp"
#include "slam_adapter/mrpt/log_mapper.hpp"
#include "tools/examples/registration.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  LogMapRequest request;
  std::optional<double> rms, max_error;
  bool lossless = false, json = false, keep_revisions = false;
  std::string poses, trajectory, channels = "all", max_memory, progress = "auto", effort = "default";
  double angle_degrees = 0, voxel_m = 0, reach_m = 0;
  int decimation = 1;
};

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  std::stringstream in(text);
  for (std::string part; std::getline(in, part, ',');) {
    if (!part.empty()) parts.push_back(part);
  }
  return parts;
}

/// Points of a scan lie as close together as its range is short: half of them within `median`.
double usual_voxel(const std::vector<Vec3>& scan) {
  std::vector<double> ranges;
  for (const Vec3& p : scan) ranges.push_back(std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]));
  if (ranges.empty()) return 0.1;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
  std::nth_element(ranges.begin(), middle, ranges.end());
  return std::clamp(0.01 * *middle, 0.01, 0.5);
}

/// GICP on points thinned alike, so that no surface weighs more for having been seen more often.
Result<MapPose> register_scan(const PointCloud& scan, const LocalMapView& view, const MapPose& guess,
                              double voxel_m, double reach_m) {
  std::vector<Vec3> finite;
  for (const Vec3& p : scan.xyz) {
    if (is_finite(p)) finite.push_back(p);
  }
  const double voxel = voxel_m > 0 ? voxel_m : usual_voxel(finite);
  examples::RegistrationSettings settings;
  settings.scan_voxel_m = settings.map_voxel_m = voxel;
  settings.reach_m = reach_m > 0 ? reach_m : 10 * voxel;
  MAPCODEC_ASSIGN(const auto found,
                  examples::register_gicp(finite, view, examples::to_isometry(guess), settings));
  return examples::to_pose(found.T_map_scan);
}

Status choose_poses(Arguments& a) {
  using Poses = LogMapRequest::Poses;
  LogMapRequest& r = a.request;
  if (a.poses.empty() && !r.pose_file.empty()) a.poses = "file";
  r.poses = a.poses.empty()         ? Poses::best
            : a.poses == "odometry" ? Poses::odometry
            : a.poses == "icp"      ? Poses::icp
            : a.poses == "log"      ? Poses::log
                                    : Poses::file;
  if (r.poses == Poses::file && r.pose_file.empty()) {
    if (a.poses == "file") {
      r.poses = Poses::log;  // without a file of its own, the log is the file
    } else {
      r.pose_file = a.poses;
    }
  }
  if (r.poses != Poses::file && !r.pose_file.empty())
    return make_error(ErrorCode::kInvalidArgument, "--poses-file is for --poses file");
  if (examples::has_pcl()) {
    r.registrar = [voxel = a.voxel_m, reach = a.reach_m](const PointCloud& scan, const LocalMapView& view,
                                                         const MapPose& guess) {
      return register_scan(scan, view, guess, voxel, reach);
    };
  }
  return {};
}

Status complete(Arguments& a) {
  LogMapRequest& r = a.request;
  CompressOptions& o = r.create;
  if (a.rms) o.promise_m = *a.rms;
  if (a.max_error) o.promise = PromiseKind::max_error, o.promise_m = *a.max_error;
  if (a.lossless) o.promise = PromiseKind::lossless, o.promise_m = 0;
  o.channels = split(a.channels);
  o.stop = stop_flag();
  if (!a.max_memory.empty()) {
    MAPCODEC_ASSIGN(o.max_memory_bytes, parse_size(a.max_memory));
  }
  r.keyframe_rad = a.angle_degrees * std::numbers::pi / 180;
  r.read.decimation = static_cast<std::uint8_t>(a.decimation);
  r.pending = a.effort == "fast";
  r.timestamp_s = commit_time();
  return choose_poses(a);
}

/// The keyframes' poses as TUM writes them: stamp, position, quaternion.
Status write_trajectory(const MapFile& map, const std::string& path) {
  std::string text = "# stamp x y z qx qy qz qw: T_map_vehicle of each keyframe\n";
  for (const Submap& s : map.archive().info().submaps) {
    if (s.name.empty()) continue;
    const auto& [x, y, z] = s.translation_m;
    const auto& [qx, qy, qz, qw] = s.rotation_xyzw;
    text += fmt::format("{:.6f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", s.first_stamp_s, x, y, z,
                        qx, qy, qz, qw);
  }
  OutputFile out;
  MAPCODEC_TRY(out.open(path));
  MAPCODEC_TRY(out.append(text));
  return out.commit();
}

Json report_json(const MapFile& map, const LogMapReport& r) {
  Json j = info_json(map);
  j["keyframes"] = r.keyframes;
  j["observations"] = r.frames;
  j["poses"] = r.poses;
  j["without_pose"] = r.without_pose;
  j["thinned_out"] = r.thinned_out;
  j["not_registered"] = r.lost;
  j["resumed_at"] = r.resumed_at;
  j["commits"] = r.commits;
  j["peak_memory_bytes"] = peak_memory_bytes();
  j["warnings"] = r.warnings;
  return j;
}

int run(Arguments& a) {
  if (const Status s = complete(a); !s.ok()) {
    fail("rawlog", s.error());
    return kUsage;
  }
  a.request.create.progress = progress_printer(a.progress);
  const auto report = map_log(a.request);
  a.request.create.progress = {};
  if (!report.ok())
    return fail(report.error().code == ErrorCode::kCannotWrite ? a.request.map : a.request.log,
                report.error());
  for (const std::string& warning : report->warnings) spdlog::warn("note: {}", warning);
  if (!a.keep_revisions) {
    CompactSettings settings;
    settings.stop = [stop = stop_flag()] { return stop->load(); };
    if (const auto done = compact_archive(a.request.map, settings); !done.ok())
      return fail(a.request.map, done.error());
  }
  const auto map = MapFile::open(a.request.map);
  if (!map.ok()) return fail(a.request.map, map.error());
  if (!a.trajectory.empty()) {
    if (const Status s = write_trajectory(*map, a.trajectory); !s.ok()) return fail(a.trajectory, s.error());
  }
  if (a.json) {
    fmt::print("{}\n", json_text(report_json(*map, *report)));
    return kDone;
  }
  print_info(*map);
  fmt::print("{:<12} {} of {} observations, poses: {}; peak memory {}\n", "keyframes",
             human_count(report->keyframes), human_count(report->frames), report->poses,
             human_bytes(peak_memory_bytes()));
  return kDone;
}

void add_poses(CLI::App& verb, Arguments& a) {
  verb.add_option(
      "--poses", a.poses,
      "file (see --poses-file; without it: the log's own), log, odometry, icp, or a file's path; default: "
      "what the log has");
  verb.add_option("--poses-file", a.request.pose_file,
                  "T_map_vehicle as TUM (8 columns), KITTI (12) or MRPT text (7, flat: 4), or a simplemap");
  verb.add_option("--trajectory", a.trajectory, "Also writes the keyframes' poses here (TUM)");
  verb.add_option("--sensor", a.request.read.sensors, "Only observations with this label; may be repeated");
  verb.add_option("--decimation", a.decimation, "Of range images: one point per block of NxN pixels")
      ->check(CLI::Range(1, 64));
  verb.add_option("--keyframe-distance", a.request.keyframe_m,
                  "Keyframes are at least this far apart [m], or turned; default: every observation is one")
      ->check(CLI::NonNegativeNumber);
  verb.add_option("--keyframe-angle", a.angle_degrees, "[degrees]")->check(CLI::NonNegativeNumber);
  verb.add_option("--icp-voxel", a.voxel_m,
                  "Scans are thinned for registration [m]; default: a hundredth of their range")
      ->check(CLI::PositiveNumber);
  verb.add_option("--icp-reach", a.reach_m, "How far off the first guess may be [m]; default: 10 voxels")
      ->check(CLI::PositiveNumber);
}

void add_coding(CLI::App& verb, Arguments& a) {
  auto* promise = verb.add_option_group("promise", "What is kept; one of these (default --rms 0.01)");
  promise->add_option("--rms", a.rms, "[m]")->check(CLI::PositiveNumber);
  promise->add_option("--max-error", a.max_error, "[m]")->check(CLI::PositiveNumber);
  promise->add_flag("--lossless", a.lossless, "Every bit");
  promise->require_option(0, 1);
  verb.add_option("--color-error", a.request.create.color_error,
                  "Mean RGB distance allowed, 0..255; 0 = exact")
      ->check(CLI::NonNegativeNumber)
      ->each([&a](const std::string&) { a.request.create.color_error_asked = true; });
  verb.add_option("--channels", a.channels, "all, none, or names separated by commas");
  verb.add_option("--tile-size", a.request.create.tile_size_m, "Side of a tile [m]")
      ->check(CLI::PositiveNumber);
  verb.add_option("--effort", a.effort, "fast: coded for good later, by compact")
      ->check(CLI::IsMember({"fast", "default"}));
  verb.add_flag("--keep-revisions", a.keep_revisions, "Every commit stays a revision; the archive is larger");
}

}  // namespace

void add_rawlog(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("rawlog",
                                      "An MRPT rawlog or simplemap in; a map of keyframes out. The same "
                                      "command goes on after an interruption");
  verb->add_option("LOG", a->request.log, "FILE.rawlog or FILE.simplemap, zipped or not")->required();
  verb->add_option("-o,--output", a->request.map, "The archive, MAP.mapc")->required();
  add_poses(*verb, *a);
  add_coding(*verb, *a);
  verb->add_option("--threads", a->request.create.threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_option("--max-memory", a->max_memory, "Such as 512M or 2G, the reader's process included");
  verb->add_option("--progress", a->progress, "auto, bar, plain, json or none, on stderr")
      ->check(CLI::IsMember({"auto", "bar", "plain", "json", "none"}));
  verb->add_flag("--json", a->json, "Summary as JSON on stdout");
  verb->add_flag("--force", a->request.create.overwrite, "Begin anew, and replace an existing output");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
