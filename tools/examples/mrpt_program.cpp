// SPDX-License-Identifier: GPL-3.0-or-later
// A program that uses MRPT, and our maps: it takes a map of keyframes, hands its points to MRPT, and asks the
// map around a robot as it would ask any map of MRPT's: how likely is a scan, what is near, where was it
// taken.
//   mrpt_program MAP.mapc
#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/poses/CPose3D.h>
#include <mrpt/poses/CPose3DPDF.h>
#include <mrpt/poses/CPose3DQuat.h>
#include <mrpt/slam/CICP.h>

#include <cmath>
#include <cstdio>

#include "slam_adapter/map_file.hpp"
#include "slam_adapter/mrpt/local_metric_map.hpp"
#include "slam_adapter/mrpt/points_map.hpp"

namespace {

using namespace mapcodec;
using mrpt::poses::CPose3D;

/// The last keyframe's points as an observation, and where the map says it was taken.
struct Keyframe {
  mrpt::maps::CSimplePointsMap::Ptr points = mrpt::maps::CSimplePointsMap::Create();
  MapPose pose;
};

Result<Keyframe> last_keyframe(const MapFile& file) {
  const auto& submaps = file.archive().info().submaps;
  if (submaps.empty()) return make_error(ErrorCode::kEmpty, "the map has no keyframe");
  const auto last = static_cast<std::uint32_t>(submaps.size() - 1);
  PointCloud cloud = file.schema().layout();
  for (std::size_t i = 0; i < file.archive().tiles().size(); ++i) {
    if (file.archive().tiles()[i].submap != last) continue;
    MAPCODEC_ASSIGN(const PointCloud tile, file.read_tile_in_submap(i));
    cloud.append(tile);
  }
  Keyframe k;
  MAPCODEC_TRY(to_points_map(cloud, *k.points));
  k.pose = {submaps[last].translation_m, submaps[last].rotation_xyzw};
  return k;
}

/// The whole map, with its colours, in MRPT's own class.
Status show_whole_map(const MapFile& file) {
  MAPCODEC_ASSIGN(const PointCloud cloud, file.read());
  mrpt::maps::CColouredPointsMap colored;
  MAPCODEC_TRY(to_points_map(cloud, colored));
  float x, y, z, r, g, b;
  colored.getPointRGB(0, x, y, z, r, g, b);
  std::printf("points %zu\nfirst %.3f %.3f %.3f rgb %.3f %.3f %.3f\n", colored.size(), double(x), double(y),
              double(z), double(r), double(g), double(b));
  return {};
}

Status ask(const char* path) {
  MAPCODEC_ASSIGN(const MapFile file, MapFile::open(path));
  MAPCODEC_TRY(show_whole_map(file));
  MAPCODEC_ASSIGN(const Keyframe keyframe, last_keyframe(file));

  Arena arena(2);
  LocalMapSettings settings;
  settings.radius_m = 20;
  MAPCODEC_ASSIGN(const auto local, LocalMap::open(path, settings, arena));
  MAPCODEC_TRY(local->move_to(keyframe.pose));
  MAPCODEC_ASSIGN(const bool ready, local->wait_ready(60));
  if (!ready) return make_error(ErrorCode::kUnreadable, "the map around the robot did not come in time");
  LocalMetricMap map(local->view());

  mrpt::obs::CObservationPointCloud scan;
  scan.pointcloud = keyframe.points;
  const auto& [x, y, z] = keyframe.pose.translation_m;
  const auto& [qx, qy, qz, qw] = keyframe.pose.rotation_xyzw;
  const CPose3D truth(mrpt::poses::CPose3DQuat(x, y, z, mrpt::math::CQuaternionDouble(qw, qx, qy, qz)));
  const CPose3D beside = truth + CPose3D(0.1, -0.05, 0.03, 0.02, 0, 0);
  std::printf("likelihood %.4f\nlikelihood_beside %.4f\n", map.computeObservationLikelihood(scan, truth),
              map.computeObservationLikelihood(scan, beside));

  mrpt::math::TPoint3Df point;
  float squared = 0;
  if (map.nearest({float(x), float(y), float(z)}, 100, point, squared))
    std::printf("nearest %.3f %.3f %.3f at %.3f m\n", double(point.x), double(point.y), double(point.z),
                std::sqrt(double(squared)));

  mrpt::slam::CICP icp;
  icp.options.thresholdDist = 0.3;
  icp.options.corresponding_points_decimation = 10;
  icp.options.onlyUniqueRobust = false;
  mrpt::slam::CICP::TReturnInfo info;
  const auto found = icp.Align3D(&map, keyframe.points.get(), beside, info)->getMeanVal();
  const CPose3D off = found - truth;
  std::printf("icp_goodness %.3f\nicp_off_m %.4f\nicp_off_rad %.4f\n", double(info.goodness), off.norm(),
              std::hypot(off.yaw(), off.pitch(), off.roll()));
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const Status s = ask(argv[1]);
  if (s.ok()) return 0;
  std::fprintf(stderr, "mrpt_program: %s\n", s.error().to_string().c_str());
  return 1;
}
