// SPDX-License-Identifier: GPL-3.0-or-later
// What MRPT itself makes of one of its files: it loads the file whole and inserts every observation into a
// coloured points map, as its own programs do. Shares no code with our reader; `bench mrpt` and the tests
// compare with it.
//
//   mrpt_peer FILE [--poses TUM_FILE] [--map MAP_POINTS.xyz] [--resave OUT.simplemap]
// Prints JSON: observations, points, bounds.
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/maps/CMultiMetricMap.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CActionRobotMovement3D.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/obs/registerAllClasses.h>
#include <mrpt/poses/CPose3DQuat.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

namespace {

using mrpt::poses::CPose3D;
using Points = mrpt::maps::CColouredPointsMap;

void keep_everything(Points& map) {
  map.insertionOptions.minDistBetweenLaserPoints = 0;
  map.insertionOptions.addToExistingPointsMap = true;
  map.insertionOptions.also_interpolate = false;
  map.insertionOptions.disableDeletion = true;
  map.insertionOptions.fuseWithExisting = false;
  map.insertionOptions.isPlanarMap = false;
  map.insertionOptions.horizontalTolerance = 100;
  map.insertionOptions.maxDistForInterpolatePoints = 0;
  map.insertionOptions.insertInvalidPoints = false;
  map.colorScheme.scheme = Points::cmFromIntensityImage;
}

class Reading {
 public:
  Reading() { keep_everything(points_); }

  std::map<double, CPose3D> poses;  // by stamp; where there are some, nothing else counts

  void insert(const mrpt::obs::CObservation& o, CPose3D pose) {
    if (!poses.empty()) {
      const auto at = poses.lower_bound(mrpt::Clock::toDouble(o.timestamp) - 1e-4);
      if (at == poses.end()) return;
      pose = at->second;
    }
    if (const auto* image = dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(&o)) {
      insert_image(*image, pose);
    } else if (const auto* cloud = dynamic_cast<const mrpt::obs::CObservationPointCloud*>(&o)) {
      insert_cloud(*cloud, pose);
    } else if (points_.insertObservation(o, pose)) {
      ++observations_;
    }
  }

  void rawlog(const std::string& path) {
    mrpt::obs::CRawlog log;
    if (!log.loadFromRawLogFile(path)) throw std::runtime_error("MRPT cannot load it");
    // CRawlog::detectImagesDirectory of 2.5.8 forgets a slash.
    mrpt::img::CImage::setImagesPathBase(path.substr(0, path.rfind('.')) + "_Images");
    CPose3D pose;
    for (std::size_t i = 0; i < log.size(); ++i) {
      switch (log.getType(i)) {
        case mrpt::obs::CRawlog::etActionCollection:
          pose = pose + step_of(*log.getAsAction(i));
          break;
        case mrpt::obs::CRawlog::etSensoryFrame:
          for (const auto& o : *log.getAsObservations(i)) insert(*o, pose);
          break;
        case mrpt::obs::CRawlog::etObservation: {
          const auto o = log.getAsObservation(i);
          if (const auto odometry = std::dynamic_pointer_cast<mrpt::obs::CObservationOdometry>(o)) {
            pose = CPose3D(odometry->odometry);
          } else if (const auto at = std::dynamic_pointer_cast<mrpt::obs::CObservationRobotPose>(o)) {
            pose = at->pose.mean;
          } else {
            insert(*o, pose);
          }
          break;
        }
        default:
          break;
      }
    }
  }

  void simplemap(const std::string& path, const std::string& resave) {
    mrpt::maps::CSimpleMap map;
    if (!map.loadFromFile(path)) throw std::runtime_error("MRPT cannot load it");
    for (std::size_t i = 0; i < map.size(); ++i) {
      const auto [pose, frame] = map.get(i);
      for (const auto& o : *frame) insert(*o, pose->getMeanVal());
    }
    if (!resave.empty()) map.saveToFile(resave);
  }

  void object(const std::string& path) {
    mrpt::io::CFileGZInputStream file(path);
    const auto object = mrpt::serialization::archiveFrom(file).ReadObject();
    if (const auto many = std::dynamic_pointer_cast<mrpt::maps::CMultiMetricMap>(object)) {
      for (const auto& m : many->maps) whole_map(*m);
    } else if (const auto one = std::dynamic_pointer_cast<mrpt::maps::CMetricMap>(object)) {
      whole_map(*one);
    }
  }

  void print() const {
    const auto box = points_.empty() ? mrpt::math::TBoundingBoxf() : points_.boundingBox();
    std::printf(
        "{\"observations\": %zu, \"points\": %zu, \"min\": [%.9g, %.9g, %.9g], \"max\": [%.9g, %.9g, "
        "%.9g]}\n",
        observations_, points_.size(), double(box.min.x), double(box.min.y), double(box.min.z),
        double(box.max.x), double(box.max.y), double(box.max.z));
  }

  void write(const std::string& path) const {
    std::ofstream out(path);
    char line[128];
    for (std::size_t i = 0; i < points_.size(); ++i) {
      float x, y, z, r, g, b;
      points_.getPointRGB(i, x, y, z, r, g, b);
      std::snprintf(line, sizeof line, "%.9g %.9g %.9g %d %d %d\n", double(x), double(y), double(z),
                    int(r * 255 + 0.5F), int(g * 255 + 0.5F), int(b * 255 + 0.5F));
      out << line;
    }
  }

 private:
  static CPose3D step_of(const mrpt::obs::CActionCollection& actions) {
    if (const auto flat = actions.getBestMovementEstimation()) return CPose3D(flat->poseChange->getMeanVal());
    const auto action = actions.getActionByClass<mrpt::obs::CActionRobotMovement3D>();
    return action ? action->poseChange.mean : CPose3D();
  }

  /// MRPT's maps take range images only where their points were made before.
  void insert_image(const mrpt::obs::CObservation3DRangeScan& o, const CPose3D& pose) {
    mrpt::obs::T3DPointsProjectionParams projection;
    projection.takeIntoAccountSensorPoseOnRobot = true;
    projection.robotPoseInTheWorld = pose;
    Points projected;
    const_cast<mrpt::obs::CObservation3DRangeScan&>(o).unprojectInto(projected, projection);
    points_.insertAnotherMap(&projected, CPose3D());
    ++observations_;
  }

  /// MRPT 2.5.8's insertObservation leaves out the pose of the robot for this class.
  void insert_cloud(const mrpt::obs::CObservationPointCloud& o, const CPose3D& pose) {
    if (!o.pointcloud) return;
    points_.insertAnotherMap(o.pointcloud.get(), pose + o.sensorPose);
    ++observations_;
  }

  void whole_map(const mrpt::maps::CMetricMap& map) {
    const auto* points = dynamic_cast<const mrpt::maps::CPointsMap*>(&map);
    if (points == nullptr) return;
    points_.insertAnotherMap(points, CPose3D());
    ++observations_;
  }

  Points points_;
  std::size_t observations_ = 0;
};

std::map<double, CPose3D> read_tum(const std::string& path) {
  std::map<double, CPose3D> poses;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    double v[8];
    int n = 0;
    while (n < 8 && words >> v[n]) ++n;
    if (n < 8) continue;
    poses[v[0]] = CPose3D(
        mrpt::poses::CPose3DQuat(v[1], v[2], v[3], mrpt::math::CQuaternionDouble(v[7], v[4], v[5], v[6])));
  }
  return poses;
}

int run(int argc, char** argv) {
  const std::string path = argv[1];
  Reading reading;
  std::string points, resave;
  for (int i = 2; i + 1 < argc; i += 2) {
    const std::string word = argv[i];
    if (word == "--poses") reading.poses = read_tum(argv[i + 1]);
    if (word == "--map") points = argv[i + 1];
    if (word == "--resave") resave = argv[i + 1];
  }
  if (path.find(".simplemap") != std::string::npos) {
    reading.simplemap(path, resave);
  } else if (path.find(".rawlog") != std::string::npos) {
    reading.rawlog(path);
  } else {
    reading.object(path);
  }
  reading.print();
  if (!points.empty()) reading.write(points);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  mrpt::obs::registerAllClasses_mrpt_obs();
  mrpt::maps::registerAllClasses_mrpt_maps();
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "mrpt_peer: %s\n", e.what());
    return 1;
  }
}
