// SPDX-License-Identifier: GPL-3.0-or-later
// How encoding and decoding of one large cloud grow with cores: measured here, scheduled for more.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>

#include "mapcodec/cloud/cloud_source.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/map_file.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/report.hpp"
#include "tools/bench/schedule.hpp"
#include "tools/peers/grid.hpp"

namespace mapcodec {
namespace {

constexpr double kScalingBound = 0.005;  // [m]

using bench::digits;
using bench::Json;
using bench::TaskGraph;

constexpr int kRepeats = 3;
constexpr std::size_t kScheduledCores[] = {1, 2, 4, 8, 16, 32, 64};

/// The fastest of the repeats on one number of threads.
struct Timing {
  int threads = 1;
  CompressReport encode;
  double encode_processor_seconds = 0;  ///< of the process, in the repeat that needed least
  double decode_seconds = 0, decode_processor_seconds = 0;
  std::vector<double> tile_decode_seconds;  ///< on one thread only
};

/// The cloud with the most points; files with few bytes are not opened for it.
Result<bench::BenchCloud> largest_cloud(const BenchSettings& settings) {
  MAPCODEC_ASSIGN(std::vector<std::string> paths, bench::find_clouds(settings));
  if (paths.empty()) return make_error(ErrorCode::kEmpty, settings.data + ": no cloud");
  std::error_code ignored;
  const auto size = [&](const std::string& p) { return std::filesystem::file_size(p, ignored); };
  return bench::load_cloud(*std::max_element(
      paths.begin(), paths.end(), [&](const auto& a, const auto& b) { return size(a) < size(b); }));
}

using Watch = peers::StopWatch;

void keep_least(double& best, double seconds) {
  if (best == 0 || seconds < best) best = seconds;
}

Status time_encoding(const PointCloud& cloud, const std::string& path, Timing& t) {
  CompressOptions o;
  o.threads = t.threads;
  o.overwrite = true;
  o.promise = PromiseKind::max_error;  // one coding pass, whatever the colours
  o.promise_m = kScalingBound;
  CloudSource source(cloud);
  const Watch processor(Watch::Kind::whole_process);
  MAPCODEC_ASSIGN(CompressReport r, compress(source, path, o));
  keep_least(t.encode_processor_seconds, processor.seconds());
  if (t.encode.seconds == 0 || r.seconds < t.encode.seconds) t.encode = std::move(r);
  return {};
}

Status time_decoding(const std::string& path, Timing& t) {
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(path));
  Arena arena(t.threads);
  ReadSettings read;
  read.arena = &arena;
  const Watch wall(Watch::Kind::wall), processor(Watch::Kind::whole_process);
  MAPCODEC_TRY(map.read(Region{}, read, [](PointCloud&&) -> Status { return {}; }));
  keep_least(t.decode_seconds, wall.seconds());
  keep_least(t.decode_processor_seconds, processor.seconds());
  return {};
}

Status time_tiles(const std::string& path, Timing& t) {
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(path));
  for (std::size_t i = 0; i < map.archive().tiles().size(); ++i) {
    const Watch watch;
    MAPCODEC_ASSIGN(const PointCloud tile, map.read_tile(i));
    t.tile_decode_seconds.push_back(watch.seconds());
  }
  return {};
}

Result<Timing> time_threads(const PointCloud& cloud, int threads, const BenchSettings& settings,
                            const std::string& path) {
  Timing t;
  t.threads = threads;
  for (int i = 0; i < (settings.quick ? 1 : kRepeats); ++i) {
    settings.say(std::to_string(threads) + " threads, repeat " + std::to_string(i + 1));
    MAPCODEC_TRY(time_encoding(cloud, path, t));
    MAPCODEC_TRY(time_decoding(path, t));
  }
  if (threads == 1) MAPCODEC_TRY(time_tiles(path, t));
  return t;
}

double sum(const std::vector<double>& v) {
  double s = 0;
  for (const double x : v) s += x;
  return s;
}

/// The graph of one thread's run. What the tiles do not explain of the process's time is serial; survey and
/// tiling count as serial wholly, though parts of them are not. Processor time, so that other processes do
/// not look like serial work.
TaskGraph make_graph(const std::vector<double>& tiles, double processor_s, double before_s, double after_s) {
  const double serial = std::max(0.0, processor_s - sum(tiles));
  const double before = std::min(before_s, serial);
  const double handing_on = std::max(0.0, serial - before - after_s);
  return {before, tiles, tiles.empty() ? 0 : handing_on / static_cast<double>(tiles.size()), after_s, 4};
}

TaskGraph encode_graph(const Timing& one) {
  const CompressReport& r = one.encode;
  return make_graph(r.tile_seconds, one.encode_processor_seconds, r.survey_seconds + r.tiling_seconds,
                    r.commit_seconds);
}

TaskGraph decode_graph(const Timing& one) {
  return make_graph(one.tile_decode_seconds, one.decode_processor_seconds, 0, 0);
}

Json measured_json(const std::vector<Timing>& timings, std::size_t points) {
  Json list = Json::array();
  const Timing& one = timings.front();
  for (const Timing& t : timings) {
    const double encode = one.encode.seconds / t.encode.seconds,
                 decode = one.decode_seconds / t.decode_seconds;
    list.push_back({{"threads", t.threads},
                    {"encode_seconds", t.encode.seconds},
                    {"encode_processor_seconds", t.encode_processor_seconds},
                    {"decode_processor_seconds", t.decode_processor_seconds},
                    {"survey_seconds", t.encode.survey_seconds},
                    {"tiling_seconds", t.encode.tiling_seconds},
                    {"tiles_seconds", t.encode.tiles_seconds},
                    {"commit_seconds", t.encode.commit_seconds},
                    {"encode_mpoints_per_s", double(points) / t.encode.seconds / 1e6},
                    {"encode_speed_up", encode},
                    {"encode_efficiency", encode / t.threads},
                    {"decode_seconds", t.decode_seconds},
                    {"decode_mpoints_per_s", double(points) / t.decode_seconds / 1e6},
                    {"decode_speed_up", decode},
                    {"decode_efficiency", decode / t.threads}});
  }
  return list;
}

Json graph_json(const TaskGraph& g) {
  const double total = bench::makespan(g, 1);
  return {
      {"tiles", g.tile_s.size()},
      {"tile_seconds", sum(g.tile_s)},
      {"longest_tile_seconds", g.tile_s.empty() ? 0 : *std::max_element(g.tile_s.begin(), g.tile_s.end())},
      {"serial_before_seconds", g.serial_before_s},
      {"serial_per_tile_seconds", g.serial_per_tile_s},
      {"serial_after_seconds", g.serial_after_s},
      {"serial_share", total > 0 ? bench::serial_seconds(g) / total : 0}};
}

Json scheduled_json(const TaskGraph& encode, const TaskGraph& decode) {
  Json list = Json::array();
  for (const std::size_t cores : kScheduledCores) {
    list.push_back({{"cores", cores},
                    {"encode_seconds", bench::makespan(encode, cores)},
                    {"encode_speed_up", bench::makespan(encode, 1) / bench::makespan(encode, cores)},
                    {"encode_tiles_speed_up",
                     [&] {
                       TaskGraph tiles = encode;
                       tiles.serial_before_s = tiles.serial_after_s = 0;
                       return bench::makespan(tiles, 1) / bench::makespan(tiles, cores);
                     }()},
                    {"decode_seconds", bench::makespan(decode, cores)},
                    {"decode_speed_up", bench::makespan(decode, 1) / bench::makespan(decode, cores)}});
  }
  return list;
}

void write_measured(bench::Report& report, const Json& measured) {
  report.line("");
  report.line("## Measured");
  report.table({"threads", "encode s", "Mpt/s", "speed-up", "efficiency", "survey s", "tiling s", "tiles s",
                "commit s", "decode s", "Mpt/s", "speed-up", "efficiency"});
  const auto cell = [](const Json& j, const char* key) { return digits(j[key].get<double>()); };
  for (const Json& j : measured) {
    std::vector<std::string> cells{std::to_string(j["threads"].get<int>())};
    for (const char* key :
         {"encode_seconds", "encode_mpoints_per_s", "encode_speed_up", "encode_efficiency", "survey_seconds",
          "tiling_seconds", "tiles_seconds", "commit_seconds", "decode_seconds", "decode_mpoints_per_s",
          "decode_speed_up", "decode_efficiency"}) {
      cells.push_back(cell(j, key));
    }
    report.row(cells);
  }
}

void write_scheduled(bench::Report& report, const Json& scheduled, const Json& graphs) {
  report.line("");
  report.line("## Scheduled from the tiles' measured seconds");
  report.line(
      "List scheduling over the pipeline's task graph; all of survey, tiling and commit taken as serial. A "
      "lower "
      "estimate: memory and caches are left out.");
  report.line(fmt::format("Serial share: encode {} %, decode {} %.",
                          digits(100 * graphs["encode"]["serial_share"].get<double>()),
                          digits(100 * graphs["decode"]["serial_share"].get<double>())));
  report.table({"cores", "encode s", "speed-up", "speed-up of the tiles alone", "decode s", "speed-up"});
  for (const Json& j : scheduled) {
    report.row({std::to_string(j["cores"].get<int>()), digits(j["encode_seconds"].get<double>()),
                digits(j["encode_speed_up"].get<double>()), digits(j["encode_tiles_speed_up"].get<double>()),
                digits(j["decode_seconds"].get<double>()), digits(j["decode_speed_up"].get<double>())});
  }
}

bench::Plot speed_up_plot(const std::string& name, const Json& measured, const Json& scheduled) {
  bench::Plot plot{fmt::format("Speed-up, {}", name), "cores", "speed-up", true, true, {}};
  bench::Series ideal{"ideal", {}, true};
  for (const std::size_t c : kScheduledCores) ideal.points.emplace_back(double(c), double(c));
  plot.series.push_back(ideal);
  for (const char* what : {"encode", "decode"}) {
    const std::string key = std::string(what) + "_speed_up";
    bench::Series here{std::string(what) + " measured", {}, false},
        there{std::string(what) + " scheduled", {}, true};
    for (const Json& j : measured) here.points.emplace_back(j["threads"].get<double>(), j[key].get<double>());
    for (const Json& j : scheduled) there.points.emplace_back(j["cores"].get<double>(), j[key].get<double>());
    plot.series.push_back(here);
    plot.series.push_back(there);
  }
  return plot;
}

Result<std::vector<Timing>> time_all(const PointCloud& cloud, int most, const BenchSettings& settings,
                                     const std::string& path) {
  std::vector<Timing> timings;
  for (int threads = 1; threads <= most; ++threads) {
    MAPCODEC_ASSIGN(Timing t, time_threads(cloud, threads, settings, path));
    timings.push_back(std::move(t));
  }
  return timings;
}

}  // namespace

Status bench_scaling(const BenchSettings& settings) {
  const int most = settings.threads > 0 ? settings.threads : bench::usable_cores();
  bench::Report report(settings, "scaling", most);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_ASSIGN(const bench::BenchCloud c, largest_cloud(settings));
  auto timings = time_all(c.cloud, most, settings, report.scratch());
  std::error_code ignored;
  std::filesystem::remove(report.scratch(), ignored);
  if (!timings.ok()) return timings.error();

  const TaskGraph encode = encode_graph(timings->front()), decode = decode_graph(timings->front());
  const Json measured = measured_json(*timings, c.cloud.size()), scheduled = scheduled_json(encode, decode);
  const Json graphs{{"encode", graph_json(encode)}, {"decode", graph_json(decode)}};
  Json& out = report.json();
  out["cloud"] = c.name;
  out["points"] = c.cloud.size();
  out["repeats"] = settings.quick ? 1 : kRepeats;
  out["measured"] = measured;
  out["task_graph"] = graphs;
  out["scheduled"] = scheduled;
  report.line(c.name + ", " + std::to_string(c.cloud.size()) + " points, all channels, best of the repeats.");
  write_measured(report, measured);
  write_scheduled(report, scheduled, graphs);
  MAPCODEC_TRY(report.plot({speed_up_plot(c.name, measured, scheduled)}, ""));
  return report.finish();
}

}  // namespace mapcodec
