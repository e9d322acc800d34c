// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/codec_run.hpp"

#include <cmath>
#include <filesystem>
#include <numeric>

#include "mapcodec/cloud/cloud_source.hpp"
#include "slam_adapter/map_file.hpp"
#include "tools/peers/grid.hpp"

namespace mapcodec::bench {
namespace {

/// Removes the archive whatever happens.
struct Scratch {
  std::string path;
  explicit Scratch(std::string p) : path(std::move(p)) {}
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
};

Status decode_by_tiles(const MapFile& map, CodecRun& run) {
  run.decoded = map.schema().layout();
  for (std::size_t i = 0; i < map.archive().tiles().size(); ++i) {
    const peers::StopWatch watch;
    MAPCODEC_ASSIGN(const PointCloud tile, map.read_tile(i));
    run.tile_decode_seconds.push_back(watch.seconds());
    run.decoded.append(tile);
  }
  return {};
}

double sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace

Result<CodecRun> run_codec(const PointCloud& cloud, const CompressOptions& options,
                           const std::string& scratch) {
  const Scratch file(scratch);
  CompressOptions o = options;
  o.overwrite = true;
  CloudSource source(cloud);
  CodecRun run;
  MAPCODEC_ASSIGN(run.report, compress(source, scratch, o));
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(scratch));
  MAPCODEC_TRY(decode_by_tiles(map, run));
  const MapSummary summary = map.summary();
  if (const auto surface = summary.codecs.find("surface"); surface != summary.codecs.end()) {
    run.surface_share = static_cast<double>(surface->second.points) / static_cast<double>(summary.points);
  }
  run.archive_bytes = summary.bytes;
  run.stated_farthest_m = std::sqrt(3.0) * summary.achieved.max_axis_error_m;
  run.tile_size_m = map.schema().tile_size_m;
  run.origin = map.schema().origin;
  run.raw_bytes = summary.raw_bytes;
  run.encode_seconds = sum(run.report.tile_seconds);
  run.decode_seconds = sum(run.tile_decode_seconds);
  return run;
}

}  // namespace mapcodec::bench
