// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/scan_submaps.hpp"

#ifdef MAPCODEC_ROSBAG
#include <cstdio>

#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/rosbag/bag_scans.hpp"
#endif

namespace mapcodec {

#ifdef MAPCODEC_ROSBAG
namespace {

std::string name_of(const BagScan& scan) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  char stamp[48];
  std::snprintf(stamp, sizeof(stamp), "@%lld.%09lld", static_cast<long long>(scan.stamp_ns / kSecond),
                static_cast<long long>(scan.stamp_ns % kSecond));
  // A submap's name holds 255 bytes.
  return scan.topic.substr(0, 200) + stamp;
}

}  // namespace

Status insert_scans(MapUpdater& map, const std::string& path, const BagOptions& options,
                    std::vector<std::string>& warnings) {
  MAPCODEC_ASSIGN(const std::unique_ptr<BagScans> scans, BagScans::open(path, options));
  BagScan scan;
  for (;;) {
    const auto more = scans->next(scan);
    if (!more.ok()) return named(path, more.error());
    if (!*more) break;
    const ScanPose pose = scan.T_map_sensor.value_or(ScanPose{});
    MAPCODEC_ASSIGN(const std::uint32_t submap,
                    map.submap(name_of(scan), PoseChange{0, pose.translation_m, pose.rotation_xyzw}));
    if (const Status s = map.insert(std::move(scan.points), submap); !s.ok()) return named(path, s.error());
  }
  for (const std::string& w : scans->warnings()) warnings.push_back(path + ": " + w);
  return {};
}
#else
Status insert_scans(MapUpdater&, const std::string& path, const BagOptions&, std::vector<std::string>&) {
  return make_error(ErrorCode::kUnsupported, path + ": this build does not read ROS bags (MAPCODEC_ROSBAG)");
}
#endif

}  // namespace mapcodec
