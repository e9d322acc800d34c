// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/decompress.hpp"

#include <chrono>

namespace mapcodec {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

bool keeps_order(const MapSchema& schema) {
  for (const ChannelSchema& c : schema.channels) {
    if (c.info.name == kOrderChannel && c.kept != ChannelKept::dropped) return true;
  }
  return false;
}

/// Sorting needs all points at once; this is the price of --keep-order.
Status write_in_order(const MapFile& map, const std::string& path, const Region& region, const ReadSettings& settings,
                      const WriteOptions& write, DecompressReport& report) {
  MAPCODEC_ASSIGN(PointCloud cloud, map.read(region, settings));
  cloud = restore_order(std::move(cloud));
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSink> sink, open_sink(path, cloud.like(), cloud.size(), write));
  MAPCODEC_TRY(sink->write(cloud));
  report.points = cloud.size();
  return sink->finish();
}

Status write_tiles(const MapFile& map, const std::string& path, const Region& region, const ReadSettings& settings,
                   const WriteOptions& write, std::uint64_t count, Clock::time_point begin, DecompressReport& report) {
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSink> sink, open_sink(path, map.schema().layout(), count, write));
  MAPCODEC_TRY(map.read(region, settings, [&](PointCloud&& cloud) -> Status {
    if (report.points == 0 && !cloud.empty()) report.first_point_seconds = seconds_since(begin);
    report.points += cloud.size();
    return sink->write(cloud);
  }));
  return sink->finish();
}

}  // namespace

Result<DecompressReport> decompress(const std::string& map_path, const std::string& path, const Region& region,
                                    std::optional<std::uint64_t> revision, const ReadSettings& settings,
                                    const WriteOptions& write) {
  const auto begin = Clock::now();
  DecompressReport report;
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path, revision));
  MAPCODEC_ASSIGN(const std::uint64_t count, map.count(region, settings));
  if (count == 0) return make_error(ErrorCode::kEmpty, "no point lies in the asked region");
  MAPCODEC_TRY(keeps_order(map.schema())
                   ? write_in_order(map, path, region, settings, write, report)
                   : write_tiles(map, path, region, settings, write, count, begin, report));
  report.tiles_read = map.tiles_in(region).size();
  report.bytes_read = map.archive().bytes_read();
  report.seconds = seconds_since(begin);
  return report;
}

}  // namespace mapcodec
