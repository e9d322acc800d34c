// SPDX-License-Identifier: GPL-3.0-or-later
// Writes small files of MRPT's into a folder: a robot in a room of boxes, seen by several kinds of sensors.
//   make_mrpt_logs FOLDER
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/io/CFileOutputStream.h>
#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/maps/CMultiMetricMap.h>
#include <mrpt/maps/COctoMap.h>
#include <mrpt/maps/CPointsMapXYZI.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/maps/CWeightedPointsMap.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/obs/CObservationRotatingScan.h>
#include <mrpt/obs/CObservationVelodyneScan.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/poses/CPose3DQuat.h>
#include <mrpt/serialization/CArchive.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace {

using namespace mrpt::obs;
using mrpt::poses::CPose3D;

constexpr double kFirstStamp = 1.6e9;
constexpr int kFrames = 8;

/// Boxes as [min, max]: a room seen from inside, and what stands in it.
struct Solid {
  double min[3], max[3];
  bool inside;
};
constexpr Solid kRoom[] = {{{-3, -4, 0}, {6, 4, 2.8}, true},
                           {{3, -1.5, 0}, {4, -0.5, 1.1}, false},
                           {{2, 2, 0}, {2.6, 3.2, 2.0}, false},
                           {{4.5, 1, 0.6}, {5.5, 2.5, 0.7}, false}};

/// Distance along a ray of unit length to the first surface.
double cast(const double* from, const double* along) {
  double nearest = 1e9;
  for (const Solid& s : kRoom) {
    double enter = -1e9, leave = 1e9;
    for (int d = 0; d < 3; ++d) {
      const double a = (s.min[d] - from[d]) / along[d], b = (s.max[d] - from[d]) / along[d];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    const double hit = s.inside ? leave : enter;
    if (enter <= leave && hit > 0) nearest = std::min(nearest, hit);
  }
  return nearest;
}

double range_from(const CPose3D& eye, const CPose3D& ray) {
  const CPose3D end = eye + ray;
  const double from[3] = {eye.x(), eye.y(), eye.z()};
  const double along[3] = {end.x() - eye.x() + 1e-12, end.y() - eye.y() + 1e-12, end.z() - eye.z() + 1e-12};
  return cast(from, along);
}

CPose3D pose_at(int i) {
  return {0.12 * i, 0.05 * i, 0, 0.04 * i, 0, 0};
}
double stamp_at(int i) {
  return kFirstStamp + 0.5 * i;
}

CObservation3DRangeScan::Ptr depth_image(int i, const CPose3D& vehicle, int shrink = 1) {
  const int kRows = 90 / shrink, kColumns = 120 / shrink;
  auto o = CObservation3DRangeScan::Create();
  o->timestamp = mrpt::Clock::fromDouble(stamp_at(i));
  o->sensorLabel = "camera";
  o->sensorPose = CPose3D(0.1, 0.02, 0.9, 0.1, 0.15, 0);
  o->cameraParams.ncols = kColumns;
  o->cameraParams.nrows = kRows;
  o->cameraParams.setIntrinsicParamsFromValues(100.0 / shrink, 100.0 / shrink, 60.0 / shrink, 45.0 / shrink);
  o->cameraParamsIntensity = o->cameraParams;
  o->range_is_depth = true;
  o->hasRangeImage = true;
  o->rangeImage_setSize(kRows, kColumns);
  o->hasIntensityImage = true;
  o->intensityImage.resize(kColumns, kRows, mrpt::img::CH_RGB);
  const CPose3D eye = vehicle + o->sensorPose;
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kColumns; ++c) {
      const double y = (60 - c * shrink) / 100.0, z = (45 - r * shrink) / 100.0,
                   length = std::sqrt(1 + y * y + z * z);
      const double range = range_from(eye, {1 / length, y / length, z / length, 0, 0, 0});
      o->rangeImage(r, c) = static_cast<uint16_t>(std::min(65000.0, range / length / double(o->rangeUnits)));
      auto* pixel = o->intensityImage.ptr<uint8_t>(unsigned(c), unsigned(r));
      pixel[0] = static_cast<uint8_t>(2 * c);
      pixel[1] = static_cast<uint8_t>(2 * r);
      pixel[2] = static_cast<uint8_t>(40 * i);
    }
  }
  return o;
}

CObservation2DRangeScan::Ptr flat_scan(int i, const CPose3D& vehicle, const char* label = "laser",
                                       std::size_t kRays = 361) {
  auto o = CObservation2DRangeScan::Create();
  o->timestamp = mrpt::Clock::fromDouble(stamp_at(i));
  o->sensorLabel = label;
  o->sensorPose = CPose3D(0.2, 0, 0.4, 0, 0, 0);
  o->aperture = 4.2F;
  o->maxRange = 20;
  o->resizeScan(kRays);
  for (std::size_t k = 0; k < kRays; ++k) {
    const double angle = double(o->aperture) * (double(k) / double(kRays - 1) - 0.5);
    const double range = range_from(vehicle + o->sensorPose, {std::cos(angle), std::sin(angle), 0, 0, 0, 0});
    o->setScanRange(k, static_cast<float>(range));
    o->setScanRangeValidity(k, range < 20);
  }
  return o;
}

CObservationOdometry::Ptr odometry(int i) {
  auto o = CObservationOdometry::Create();
  o->timestamp = mrpt::Clock::fromDouble(stamp_at(i) - 0.001);
  o->sensorLabel = "wheels";
  o->odometry = mrpt::poses::CPose2D(pose_at(i));
  return o;
}

CObservationRobotPose::Ptr robot_pose(int i) {
  auto o = CObservationRobotPose::Create();
  o->timestamp = mrpt::Clock::fromDouble(stamp_at(i));
  o->sensorLabel = "truth";
  o->pose.mean = pose_at(i);
  return o;
}

class Folder {
 public:
  explicit Folder(std::string path) : path_(std::move(path)) { std::filesystem::create_directories(path_); }
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }

  template <class F>
  void write(const std::string& name, F&& content, bool zipped = true) const {
    mrpt::io::CFileGZOutputStream zip;
    mrpt::io::CFileOutputStream plain;
    if (zipped) {
      zip.open(*this / name);
      auto out = mrpt::serialization::archiveFrom(zip);
      content(out);
    } else {
      plain.open(*this / name);
      auto out = mrpt::serialization::archiveFrom(plain);
      content(out);
    }
  }
  void object(const std::string& name, const mrpt::serialization::CSerializable& o) const {
    write(name, [&](auto& out) { out << o; });
  }

 private:
  std::string path_;
};

void depth_logs(const Folder& f) {
  f.write("depth.rawlog", [](auto& out) {
    for (int i = 0; i < kFrames; ++i) out << *odometry(i) << *depth_image(i, pose_at(i));
  });
  f.write("truth.rawlog", [](auto& out) {
    for (int i = 0; i < kFrames; ++i) out << *robot_pose(i) << *depth_image(i, pose_at(i));
  });
  f.write("no_poses.rawlog", [](auto& out) {
    for (int i = 0; i < kFrames; ++i) out << *depth_image(i, pose_at(i));
  });
  f.write("jump.rawlog", [](auto& out) {
    for (int i = 0; i < kFrames; ++i) {
      auto o = depth_image(i, pose_at(i));
      if (i >= 4) o->timestamp = mrpt::Clock::fromDouble(stamp_at(i) - 86400);
      out << *odometry(i) << *o;
    }
  });
  f.write("no_points.rawlog", [](auto& out) {
    for (int i = 0; i < kFrames; ++i) out << *odometry(i) << CObservationGPS();
  });
  f.write("two_sensors.rawlog", [](auto& out) {
    for (int i = 0; i < kFrames; ++i)
      out << *odometry(i) << *depth_image(i, pose_at(i)) << *flat_scan(i, pose_at(i));
  });
  std::filesystem::create_directories(f / "external_Images");
  f.write("external.rawlog", [&](auto& out) {
    for (int i = 0; i < kFrames; ++i) {
      auto o = depth_image(i, pose_at(i));
      const std::string name = "camera_" + std::to_string(i) + ".png";
      o->intensityImage.saveToFile(f / ("external_Images/" + name));
      o->intensityImage.setExternalStorage(name);
      out << *odometry(i) << *o;
    }
  });
}

void flat_logs(const Folder& f) {
  f.write(
      "frames.rawlog",
      [](auto& out) {
        for (int i = 0; i < kFrames; ++i) {
          CActionRobotMovement2D move;
          const CPose3D step = i == 0 ? CPose3D() : pose_at(i) - pose_at(i - 1);
          CActionRobotMovement2D::TMotionModelOptions model;
          move.computeFromOdometry(mrpt::poses::CPose2D(step), model);
          CActionCollection actions;
          actions.insert(move);
          CSensoryFrame frame;
          frame.insert(flat_scan(i, pose_at(i)));
          frame.insert(flat_scan(i, pose_at(i), "other"));
          out << actions << frame;
        }
      },
      false);
}

/// A class that MRPT does not know, alone and within a sensory frame: a known one under another name.
void unknown_log(const Folder& f) {
  f.write(
      "unknown.rawlog",
      [](auto& out) {
        for (int i = 0; i < 4; ++i) {
          CSensoryFrame frame;
          frame.insert(flat_scan(i, pose_at(i)));
          frame.insert(CObservationGPS::Create());
          out << *odometry(i) << CObservationGPS() << frame;
        }
      },
      false);
  std::ifstream in(f / "unknown.rawlog", std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  in.close();
  const std::string known = "CObservationGPS", other = "CObservationXYZ";
  for (std::size_t at = bytes.find(known); at != std::string::npos; at = bytes.find(known, at))
    bytes.replace(at, known.size(), other);
  std::ofstream(f / "unknown.rawlog", std::ios::binary) << bytes;
}

void maps(const Folder& f) {
  mrpt::maps::CSimplePointsMap simple;
  mrpt::maps::CColouredPointsMap colored;
  mrpt::maps::CPointsMapXYZI shining;
  mrpt::maps::CWeightedPointsMap weighted;
  mrpt::maps::COctoMap tree(0.1);
  for (int i = 0; i < 400; ++i) {
    const float x = 0.05F * float(i % 20), y = 0.05F * float(i / 20), z = 0.3F * x;
    simple.insertPoint(x, y, z);
    colored.insertPointRGB(x, y, z, float(i % 20) / 255, float(i / 20) / 255, 1);
    shining.insertPoint(x, y, z);
    shining.setPointIntensity(std::size_t(i), float(i) / 400);
    weighted.insertPoint(x, y, z);
    tree.updateVoxel(double(x), double(y), double(z), true);
  }
  f.object("simple.mrpt", simple);
  f.object("colored.mrpt", colored);
  f.object("shining.mrpt", shining);
  f.object("weighted.mrpt", weighted);
  f.object("tree.mrpt", tree);
  mrpt::maps::CMultiMetricMap many;
  many.maps.push_back(mrpt::maps::CSimplePointsMap::Create(simple));
  many.maps.push_back(mrpt::maps::CColouredPointsMap::Create(colored));
  f.object("many.mrpt", many);
}

void keyframes(const Folder& f) {
  mrpt::maps::CSimpleMap map;
  for (int i = 0; i < kFrames; ++i) {
    auto frame = CSensoryFrame::Create();
    frame->insert(depth_image(i, pose_at(i)));
    auto pose = mrpt::poses::CPose3DPDFGaussian::Create();
    pose->mean = pose_at(i);
    map.insert(pose, frame);
  }
  map.saveToFile(f / "keyframes.simplemap");
}

void pose_files(const Folder& f) {
  std::ofstream tum(f / "poses.tum"), kitti(f / "poses.kitti"), mrpt_text(f / "poses.txt");
  for (auto* out : {&tum, &kitti, &mrpt_text}) out->precision(17);
  tum << "# stamp x y z qx qy qz qw\n";
  mrpt_text << "% stamp x y z yaw pitch roll\n";
  for (int i = 0; i < kFrames; ++i) {
    const CPose3D p = pose_at(i);
    const mrpt::poses::CPose3DQuat q(p);
    tum << stamp_at(i) << ' ' << p.x() << ' ' << p.y() << ' ' << p.z() << ' ' << q.quat().x() << ' '
        << q.quat().y() << ' ' << q.quat().z() << ' ' << q.quat().r() << '\n';
    const auto m = p.getHomogeneousMatrixVal<mrpt::math::CMatrixDouble44>();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) kitti << m(r, c) << (r == 2 && c == 3 ? '\n' : ' ');
    }
    mrpt_text << stamp_at(i) << ' ' << p.x() << ' ' << p.y() << ' ' << p.z() << ' ' << p.yaw() << ' '
              << p.pitch() << ' ' << p.roll() << '\n';
  }
}

/// Small and not zipped, so that a changed byte changes what is read.
void seeds(const std::string& path) {
  const Folder logs(path + "/mrpt_rawlog"), keyframes_folder(path + "/mrpt_simplemap");
  CSensoryFrame frame;
  frame.insert(flat_scan(1, pose_at(1), "laser", 21));
  CActionRobotMovement2D move;
  move.computeFromOdometry(mrpt::poses::CPose2D(0.1, 0, 0), {});
  CActionCollection actions;
  actions.insert(move);
  logs.write(
      "frames.rawlog", [&](auto& out) { out << actions << frame << actions << frame; }, false);
  logs.write(
      "depth.rawlog", [](auto& out) { out << *odometry(1) << *depth_image(1, pose_at(1), 15); }, false);
  auto cloud = CObservationPointCloud::Create();
  auto points = mrpt::maps::CColouredPointsMap::Create();
  for (int i = 0; i < 10; ++i) points->insertPointRGB(float(i), 1, 2, 0.1F, 0.2F, 0.3F);
  cloud->pointcloud = points;
  logs.write(
      "cloud.rawlog", [&](auto& out) { out << *cloud << *robot_pose(1); }, false);
  CObservationRotatingScan rotating;
  rotating.fromScan2D(*flat_scan(1, pose_at(1), "laser", 21));
  logs.write(
      "rotating.rawlog", [&](auto& out) { out << rotating; }, false);
  CObservationVelodyneScan velodyne;
  velodyne.scan_packets.resize(1);
  velodyne.calibration = VelodyneCalibration::LoadDefaultCalibration("VLP16");
  auto* packet = reinterpret_cast<std::uint8_t*>(velodyne.scan_packets.data());
  for (std::size_t i = 0; i < sizeof(velodyne.scan_packets[0]); ++i)
    packet[i] = static_cast<std::uint8_t>(37 * i);
  for (std::size_t block = 0; block < 12; ++block) std::memcpy(packet + 100 * block, "\xff\xee\x10\x10", 4);
  std::memcpy(packet + 1204, "\x37\x22", 2);
  logs.write(
      "velodyne.rawlog", [&](auto& out) { out << velodyne; }, false);
  keyframes_folder.write(
      "keyframes.simplemap",
      [&](auto& out) {
        mrpt::maps::CSimpleMap map;
        auto pose = mrpt::poses::CPose3DPDFGaussian::Create();
        map.insert(pose, CSensoryFrame::Create(frame));
        auto other = CSensoryFrame::Create();
        other->insert(cloud);
        map.insert(pose, other);
        out << map;
      },
      false);
  for (const char* name : {"localization_demo.simplemap.gz"}) {
    const auto shipped = std::filesystem::path("/usr/share/mrpt/datasets") / name;
    if (std::filesystem::exists(shipped))
      std::filesystem::copy_file(shipped, keyframes_folder / name,
                                 std::filesystem::copy_options::overwrite_existing);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--seeds") {
    seeds(argv[2]);
    return 0;
  }
  if (argc != 2) return 2;
  const Folder folder(argv[1]);
  depth_logs(folder);
  flat_logs(folder);
  unknown_log(folder);
  maps(folder);
  keyframes(folder);
  pose_files(folder);
  std::ofstream(folder / "newer.rawlog", std::ios::binary).write("\x28\xb5\x2f\xfd\x04\x00\x01\x00\x00", 9);
  return 0;
}
