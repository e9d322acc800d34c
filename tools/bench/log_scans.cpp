// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/log_scans.hpp"

#include <filesystem>
#include <map>

#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/map_file.hpp"
#include "tools/bench/child.hpp"

namespace mapcodec::bench {
namespace {

namespace fs = std::filesystem;

Status write_scan(const std::string& path, const PointCloud& scan) {
  MAPCODEC_ASSIGN(const auto sink, open_sink(path, scan.like(), scan.size()));
  MAPCODEC_TRY(sink->write(scan));
  return sink->finish();
}

/// Positions of each keyframe, by the number of its submap.
Result<std::map<std::uint32_t, PointCloud>> keyframes_of(const std::string& map_path) {
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path));
  std::map<std::uint32_t, PointCloud> keyframes;
  for (std::size_t i = 0; i < map.archive().tiles().size(); ++i) {
    MAPCODEC_ASSIGN(PointCloud tile, map.read_tile(i));
    PointCloud& all = keyframes[map.archive().tiles()[i].submap];
    all.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
    all.xyz.insert(all.xyz.end(), tile.xyz.begin(), tile.xyz.end());
  }
  return keyframes;
}

}  // namespace

Result<std::vector<std::string>> scans_of_log(const std::string& log, const std::string& folder) {
  std::error_code ignored;
  fs::create_directories(folder, ignored);
  const std::string map = folder + "/log.mapc";
  std::vector<std::string> words{own_path(), "rawlog", log, "-o", map, "--lossless", "--force"};
  if (log.find(".rawlog") != log.npos) words.insert(words.end(), {"--poses", "icp"});
  MAPCODEC_TRY(output_of(words));
  MAPCODEC_ASSIGN(const auto keyframes, keyframes_of(map));
  fs::remove(map, ignored);
  std::vector<std::string> paths;
  for (const auto& [number, scan] : keyframes) {
    const std::string digits = std::to_string(number);
    paths.push_back(folder + "/" + std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0') + digits +
                    ".pcd");
    MAPCODEC_TRY(write_scan(paths.back(), scan));
  }
  return paths;
}

}  // namespace mapcodec::bench
