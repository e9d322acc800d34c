// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/log_reader.hpp"

#include <mrpt/img/CImage.h>
#include <mrpt/maps/CMultiMetricMap.h>
#include <mrpt/maps/COctoMap.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CActionRobotMovement3D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/obs/registerAllClasses.h>
#include <mrpt/poses/registerAllClasses.h>

#include <filesystem>
#include <map>

#include "maps/submap_pose.hpp"
#include "slam_adapter/mrpt/mrpt_pose.hpp"
#include "slam_adapter/mrpt/object_archive.hpp"
#include "slam_adapter/mrpt/observation_points.hpp"
#include "slam_adapter/mrpt/points_map.hpp"
#include "slam_adapter/mrpt/scan_matching.hpp"

namespace mapcodec {
namespace {

using namespace mrpt::obs;
using mrpt::poses::CPose3D;

constexpr std::uint8_t kEndOfObject = 0x88;
constexpr const char* kUnknownClass = "not known to MRPT 2.5.8";

std::string bare(const std::string& class_name) {
  const std::size_t colon = class_name.rfind(':');
  return colon == std::string::npos ? class_name : class_name.substr(colon + 1);
}

bool is_one_of(const std::string& name, std::initializer_list<const char*> names) {
  const std::string b = bare(name);
  return std::any_of(names.begin(), names.end(), [&](const char* n) { return b == n; });
}

bool is_known(const std::string& class_name) {
  return class_name == "nullptr" || mrpt::rtti::findRegisteredClass(class_name) != nullptr;
}

class LogReader {
 public:
  LogReader(ObjectArchive& in, const LogSettings& settings, const std::function<Status(RawlogFrame&&)>& emit)
      : in_(in), settings_(settings), emit_(emit) {
    projection_.decimation = settings.decimation;
    projection_.layout_alone = settings.list;
    if (settings.match_scans) matcher_ = std::make_unique<ScanMatcher>();
  }

  Status run() {
    while (!in_.at_end()) {
      if (open_containers_ > 0 && in_.peek(1)[0] == kEndOfObject) {
        in_.skip(1);
        --open_containers_;
        continue;
      }
      MAPCODEC_TRY(entry());
    }
    return {};
  }

  RawlogSummary summary() const {
    RawlogSummary s;
    s.observations = number_;
    for (const auto& [name, c] : classes_) s.classes.push_back({name, c.count, c.remark});
    return s;
  }

  /// Where the object began that is being read, and what it is.
  [[nodiscard]] const std::string& object() const { return object_; }

 private:
  struct Counted {
    std::uint64_t count = 0;
    std::string remark;
  };

  Result<ObjectHeader> next_header() {
    const auto h = in_.header();
    if (!h) {
      const bool cut = in_.peek(130).size() < 130;
      return make_error(cut ? ErrorCode::kTruncated : ErrorCode::kMalformed,
                        cut ? "ends within an object" : "no object of MRPT begins here", in_.position());
    }
    object_ = bare(h->class_name);
    return *h;
  }

  Status entry() {
    MAPCODEC_ASSIGN(const ObjectHeader h, next_header());
    if (is_one_of(h.class_name, {"CSimpleMap", "CSensFrameProbSequence"})) return keyframes(h);
    if (is_one_of(h.class_name, {"CRawlog"})) return whole_log(h);
    if (is_sensory_frame(h)) return sensory_frame(h);
    MAPCODEC_ASSIGN(const auto object, read_object());
    if (object) MAPCODEC_TRY(take(object));
    return {};
  }

  /// Null for nullptr and for classes that MRPT does not know, which are counted.
  Result<mrpt::serialization::CSerializable::Ptr> read_object() {
    MAPCODEC_ASSIGN(const ObjectHeader h, next_header());
    if (is_known(h.class_name)) {
      mrpt::serialization::CSerializable::Ptr object = in_.ReadObject();
      return object;
    }
    count(bare(h.class_name), kUnknownClass);
    skip_unknown(h);
    return mrpt::serialization::CSerializable::Ptr();
  }

  /// Objects do not say how long they are: one that MRPT does not know ends where its last byte is followed
  /// by the end of what holds it, by another object, or by nothing.
  void skip_unknown(const ObjectHeader& h) {
    in_.skip(h.length);
    while (!in_.at_end()) {
      const ByteSpan bytes = in_.peek(1 << 15);
      std::size_t at = 0;
      while (at < bytes.size() && bytes[at] != kEndOfObject) ++at;
      const bool found = at < bytes.size();
      in_.skip(at + (found ? 1 : 0));
      if (found && object_may_begin()) return;
    }
  }

  bool object_may_begin() {
    std::size_t ends = 0;
    const ByteSpan bytes = in_.peek(8);
    while (ends < bytes.size() && bytes[ends] == kEndOfObject) ++ends;
    if (ends == bytes.size()) return true;
    const auto next = in_.header(ends);
    return next && (is_known(next->class_name) || bare(next->class_name).starts_with("CObservation"));
  }

  static bool is_sensory_frame(const ObjectHeader& h) {
    // Older layouts are left to MRPT as a whole.
    return is_one_of(h.class_name, {"CSensoryFrame", "CSensorialFrame"}) && h.version == 2;
  }

  Status end_of(const ObjectHeader& h, const char* what) {
    if (h.old) return {};
    const ByteSpan next = in_.peek(1);
    if (next.empty())
      return make_error(ErrorCode::kTruncated, std::string("ends within a ") + what, in_.position());
    if (next[0] != kEndOfObject)
      return make_error(ErrorCode::kMalformed, std::string("a ") + what + " does not end where it must",
                        in_.position());
    in_.skip(1);
    return {};
  }

  std::uint32_t read_count(const ObjectHeader& h) {
    in_.skip(h.length);
    return in_.ReadAs<std::uint32_t>();
  }

  Status sensory_frame(const ObjectHeader& h) {
    ++group_;
    for (std::uint32_t left = read_count(h); left > 0; --left) {
      MAPCODEC_ASSIGN(const auto object, read_object());
      if (object) MAPCODEC_TRY(take(object));
    }
    return end_of(h, "CSensoryFrame");
  }

  Status keyframes(const ObjectHeader& h) {
    if (h.version > 1)
      return make_error(ErrorCode::kUnsupported,
                        "a simplemap of a newer MRPT than 2.5.8 (layout " + std::to_string(h.version) + ")");
    for (std::uint32_t left = read_count(h); left > 0; --left) {
      MAPCODEC_ASSIGN(const auto pose, read_object());
      pose_.reset();
      if (const auto p3 = std::dynamic_pointer_cast<mrpt::poses::CPose3DPDF>(pose)) pose_ = p3->getMeanVal();
      if (const auto p2 = std::dynamic_pointer_cast<mrpt::poses::CPosePDF>(pose))
        pose_ = CPose3D(p2->getMeanVal());
      MAPCODEC_ASSIGN(const ObjectHeader inner, next_header());
      if (is_sensory_frame(inner)) {
        MAPCODEC_TRY(sensory_frame(inner));
      } else {
        MAPCODEC_ASSIGN(const auto frame, read_object());
        if (frame) MAPCODEC_TRY(take(frame));
      }
    }
    return end_of(h, "CSimpleMap");
  }

  /// A log that was written as one object: its entries follow, and its end later.
  Status whole_log(const ObjectHeader& h) {
    (void)read_count(h);
    open_containers_ += h.old ? 0 : 1;
    return {};
  }

  Status take(const mrpt::serialization::CSerializable::Ptr& object) {
    if (const auto frame = std::dynamic_pointer_cast<CSensoryFrame>(object)) {
      ++group_;
      for (const auto& o : *frame) MAPCODEC_TRY(take_observation(*o));
      return {};
    }
    if (const auto o = std::dynamic_pointer_cast<CObservation>(object)) return take_single(*o);
    if (const auto actions = std::dynamic_pointer_cast<CActionCollection>(object))
      return take_actions(*actions);
    if (const auto map = std::dynamic_pointer_cast<mrpt::maps::CMultiMetricMap>(object)) {
      for (const auto& m : map->maps) MAPCODEC_TRY(take_map(*m));
      return {};
    }
    if (const auto map = std::dynamic_pointer_cast<mrpt::maps::CMetricMap>(object)) return take_map(*map);
    count(bare(object->GetRuntimeClass()->className), "holds no points");
    return {};
  }

  Status take_single(CObservation& o) {
    ++group_;
    return take_observation(o);
  }

  Status take_actions(const CActionCollection& actions) {
    CPose3D step;
    if (const auto flat = actions.getBestMovementEstimation(); flat && flat->poseChange) {
      step = CPose3D(flat->poseChange->getMeanVal());
    } else if (const auto action = actions.getActionByClass<CActionRobotMovement3D>()) {
      step = action->poseChange.mean;
    } else {
      return {};
    }
    odometry_ = odometry_.value_or(CPose3D()) + step;
    if (matcher_) matcher_->move(step);
    count("CActionRobotMovement", "");
    return {};
  }

  Status take_observation(CObservation& o) {
    if (const auto* odometry = dynamic_cast<const CObservationOdometry*>(&o)) {
      const CPose3D now(odometry->odometry);
      if (matcher_ && odometry_) matcher_->move(now - *odometry_);
      odometry_ = now;
    } else if (const auto* pose = dynamic_cast<const CObservationRobotPose*>(&o)) {
      pose_ = pose->pose.mean + -pose->sensorPose;
      MAPCODEC_TRY(emit_pose(o));
    }
    const std::string name = bare(o.GetRuntimeClass()->className);
    const std::uint64_t number = number_++;
    if (!gives_points(o)) {
      count(name,
            is_one_of(name, {"CObservationOdometry", "CObservationRobotPose"}) ? "" : "holds no points");
      return {};
    }
    if (!settings_.sensors.empty() && !settings_.sensors.contains(o.sensorLabel)) {
      count(name + " of '" + o.sensorLabel.substr(0, kLongestLabel) + "'", "not asked for");
      return {};
    }
    if (matcher_ && dynamic_cast<const CObservation2DRangeScan*>(&o) != nullptr) pose_ = matcher_->match(o);
    if (number < settings_.skip) return {};
    return emit_points(o, name, number);
  }

  /// Of a pose that is one: numbers in a file may be anything.
  static std::optional<MapPose> sound(const std::optional<CPose3D>& p) {
    if (!p) return std::nullopt;
    const MapPose pose = pose_of(*p);
    return check_pose(pose.translation_m, pose.rotation_xyzw).ok() ? std::optional(pose) : std::nullopt;
  }

  RawlogFrame frame_of(const std::string& name, std::uint64_t number) const {
    RawlogFrame f;
    f.number = number;
    f.group = group_;
    f.class_name = name;
    f.T_odom_vehicle = sound(odometry_);
    f.T_map_vehicle = sound(pose_);
    f.file_offset = in_.file_offset();
    return f;
  }

  Status emit_points(CObservation& o, const std::string& name, std::uint64_t number) {
    RawlogFrame f = frame_of(name, number);
    std::string why;
    try {
      why = take_points(o, projection_, f);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& e) {  // as where an image beside the log is missing
      why = "MRPT cannot project it: " + message_of(e.what());
    }
    if (why.empty() && !check_pose(f.T_vehicle_sensor.translation_m, f.T_vehicle_sensor.rotation_xyzw).ok())
      why = "its sensor's pose is none";
    count(name, why);
    return why.empty() ? emit_(std::move(f)) : Status{};
  }

  Status emit_pose(const CObservation& o) {
    if (!settings_.list) return {};
    RawlogFrame f = frame_of(bare(o.GetRuntimeClass()->className), number_);
    f.sensor = o.sensorLabel.substr(0, kLongestLabel);
    if (o.timestamp != INVALID_TIMESTAMP) f.stamp_s = mrpt::Clock::toDouble(o.timestamp);
    return emit_(std::move(f));
  }

  Status take_map(const mrpt::maps::CMetricMap& map) {
    const std::string name = bare(map.GetRuntimeClass()->className);
    RawlogFrame f = frame_of(name, number_++);
    f.group = ++group_;
    if (const auto* points = dynamic_cast<const mrpt::maps::CPointsMap*>(&map)) {
      f.points = cloud_of(*points);
    } else if (const auto* tree = dynamic_cast<const mrpt::maps::COctoMap*>(&map)) {
      f.points = centres_of(*tree);
    } else {
      count(name, "holds no points");
      return {};
    }
    if (settings_.list) f.points = f.points.like();
    count(name, "");
    return emit_(std::move(f));
  }

  /// Of the occupied leaves.
  static PointCloud centres_of(const mrpt::maps::COctoMap& tree) {
    mrpt::maps::CSimplePointsMap points;
    auto voxels = mrpt::opengl::COctoMapVoxels::Create();
    tree.getAsOctoMapVoxels(*voxels);
    for (std::size_t i = 0; i < voxels->getVoxelCount(mrpt::opengl::VOXEL_SET_OCCUPIED); ++i) {
      const auto& v = voxels->getVoxel(mrpt::opengl::VOXEL_SET_OCCUPIED, i);
      points.insertPointFast(v.coords.x, v.coords.y, v.coords.z);
    }
    return cloud_of(points);
  }

  /// MRPT's exceptions are several lines; one says what is wrong.
  static std::string message_of(std::string text) {
    const std::string_view mark = "Message:";
    if (const std::size_t at = text.find(mark); at != std::string::npos) text.erase(0, at + mark.size());
    text.erase(0, text.find_first_not_of(" \t"));
    const std::size_t end = text.find_first_of("\n\r");
    if (end != std::string::npos) text.resize(end);
    return text.substr(0, 300);
  }

  void count(const std::string& name, const std::string& remark) {
    constexpr std::size_t kMostClasses = 1000;  // names come from the file
    if (classes_.size() >= kMostClasses && !classes_.contains(name)) return;
    Counted& c = classes_[name];
    ++c.count;
    if (c.remark.empty()) c.remark = remark;
  }

  ObjectArchive& in_;
  const LogSettings& settings_;
  const std::function<Status(RawlogFrame&&)>& emit_;
  ProjectionSettings projection_;
  std::unique_ptr<ScanMatcher> matcher_;
  std::map<std::string, Counted> classes_;
  std::optional<CPose3D> odometry_, pose_;
  std::uint64_t number_ = 0, group_ = 0;
  std::size_t open_containers_ = 0;
  std::string object_ = "object";
};

/// What MRPT threw, as one sentence.
Error explained(const ObjectArchive& in, const std::string& object, const std::string& thrown) {
  if (!in.unpacking_error().empty()) {
    const bool cut = in.unpacking_error().find("breaks off") != std::string::npos;
    return make_error(cut ? ErrorCode::kTruncated : ErrorCode::kMalformed, in.unpacking_error(),
                      in.position());
  }
  if (in.ran_out()) return make_error(ErrorCode::kTruncated, "ends within a " + object, in.position());
  if (thrown.find("nknown serialization version") != std::string::npos ||
      thrown.find("unknown version") != std::string::npos)
    return make_error(
        ErrorCode::kUnsupported,
        "a " + object + " in a layout that MRPT 2.5.8 does not know (a newer MRPT's, or damaged)",
        in.position());
  return make_error(ErrorCode::kMalformed, "MRPT cannot read a " + object, in.position());
}

/// Images beside a log lie in NAME_Images or Images. MRPT 2.5.8 looks for them in the wrong place where the
/// log's path has a folder.
std::string images_folder(const std::string& path) {
  namespace fs = std::filesystem;
  fs::path name = fs::path(path).filename();
  if (name.extension() == ".gz") name = name.stem();
  const fs::path folder = fs::path(path).parent_path(), own = folder / (name.stem().string() + "_Images");
  std::error_code ignored;
  return (fs::is_directory(own, ignored) ? own : folder / "Images").string();
}

void register_classes() {
  mrpt::poses::registerAllClasses_mrpt_poses();
  mrpt::obs::registerAllClasses_mrpt_obs();
  mrpt::maps::registerAllClasses_mrpt_maps();
}

}  // namespace

Result<RawlogSummary> read_log(const std::string& path, const LogSettings& settings,
                               const std::function<Status(RawlogFrame&&)>& emit) {
  MAPCODEC_ASSIGN(const std::unique_ptr<ObjectArchive> in, ObjectArchive::open(path));
  register_classes();
  mrpt::img::CImage::setImagesPathBase(images_folder(path));
  LogReader reader(*in, settings, emit);
  try {
    MAPCODEC_TRY(reader.run());
    if (!in->unpacking_error().empty()) return explained(*in, reader.object(), {});
    return reader.summary();
  } catch (const std::bad_alloc&) {
    return make_error(ErrorCode::kLimitExceeded,
                      "a " + reader.object() + " asks for more memory than the reader may use",
                      in->position());
  } catch (const std::exception& e) {
    return explained(*in, reader.object(), e.what());
  } catch (...) {
    return explained(*in, reader.object(), {});
  }
}

}  // namespace mapcodec
