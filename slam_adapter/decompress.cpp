// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/decompress.hpp"

#include <chrono>

namespace mapcodec {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

bool keeps_order(const MapSchema& schema) {
  for (const ChannelSchema& c : schema.channels) {
    if (c.info.name == kOrderChannel && c.kept != ChannelKept::dropped) return true;
  }
  return false;
}

/// Most points that a region's tiles may hold for it to be read in one go.
constexpr std::uint64_t kAtOnce = 8000000;

std::uint64_t points_of_tiles(const MapFile& map, const Region& region) {
  std::uint64_t points = 0;
  for (const std::size_t i : map.tiles_in(region)) points += map.archive().tiles()[i].points;
  return points;
}

/// All points at once: for sorting them (the price of --keep-order), and for small regions, whose tiles are
/// then decoded once instead of a first time for their count.
Status write_at_once(const MapFile& map, const std::string& path, const Region& region,
                     const ReadSettings& settings, const WriteOptions& write, Clock::time_point begin,
                     DecompressReport& report) {
  PointCloud cloud = map.layout(settings);
  MAPCODEC_TRY(map.read(region, settings, [&](PointCloud&& tile) {
    if (cloud.empty() && !tile.empty()) report.first_point_seconds = seconds_since(begin);
    cloud.append(tile);
    return Status{};
  }));
  if (cloud.empty()) return make_error(ErrorCode::kEmpty, "no point lies in the asked region");
  cloud = restore_order(std::move(cloud));
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSink> sink, open_sink(path, cloud.like(), cloud.size(), write));
  MAPCODEC_TRY(sink->write(cloud));
  report.points = cloud.size();
  return sink->finish();
}

Status write_tiles(const MapFile& map, const std::string& path, const Region& region,
                   const ReadSettings& settings, const WriteOptions& write, Clock::time_point begin,
                   DecompressReport& report) {
  MAPCODEC_ASSIGN(const std::uint64_t count, map.count(region, settings));
  if (count == 0) return make_error(ErrorCode::kEmpty, "no point lies in the asked region");
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSink> sink, open_sink(path, map.layout(settings), count, write));
  MAPCODEC_TRY(map.read(region, settings, [&](PointCloud&& cloud) -> Status {
    if (report.points == 0 && !cloud.empty()) report.first_point_seconds = seconds_since(begin);
    report.points += cloud.size();
    return sink->write(cloud);
  }));
  return sink->finish();
}

}  // namespace

Result<DecompressReport> decompress(const std::string& map_path, const std::string& path,
                                    const Region& region, std::optional<std::uint64_t> revision,
                                    const ReadSettings& settings, const WriteOptions& write) {
  const auto begin = Clock::now();
  DecompressReport report;
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path, revision));
  if (settings.level && !map.has_levels())
    return make_error(ErrorCode::kUnsupported, "has no tile with levels of detail (surface or points)");
  const bool at_once = (!settings.level && keeps_order(map.schema())) ||
                       (!region.everything() && points_of_tiles(map, region) <= kAtOnce);
  MAPCODEC_TRY((at_once ? write_at_once : write_tiles)(map, path, region, settings, write, begin, report));
  report.tiles_read = map.tiles_in(region).size();
  report.bytes_read = map.archive().bytes_read();
  report.seconds = seconds_since(begin);
  return report;
}

}  // namespace mapcodec
