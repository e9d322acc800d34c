// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "mapcodec/cloud/cloud_source.hpp"
#include "slam_adapter/create_map.hpp"
#include "slam_adapter/map_file.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/update.hpp"
#include "tools/peers/grid.hpp"

namespace mapcodec::bench {
namespace {

using Watch = peers::StopWatch;

constexpr double kPromise = 0.02;  // [m] max_error: what a map for navigation has
constexpr double kPeriod = 0.1;    // [s] of a turn of the sensor
constexpr double kStride = 2;      // [m] that the sensor moves between scans

/// A real scan of a spinning lidar, cut to what one turn of a 130,000-point sensor gives by standing where it
/// stood again with a small turn: never the same points twice.
PointCloud scan_at(const PointCloud& real, double x, unsigned seed) {
  std::mt19937 random(seed);
  const double turn = 0.02 * (double(random()) / 4294967296.0 - 0.5),
               lift = 0.02 * double(random()) / 4294967296.0;
  PointCloud c = real;
  for (Vec3& p : c.xyz) {
    const double s = std::sin(turn), k = std::cos(turn);
    p = {k * p[0] - s * p[1] + x, s * p[0] + k * p[1], p[2] + lift};
  }
  c.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
  return c;
}

/// The scan with the most points of a spinning lidar, twice with an offset: about 130,000 points.
Result<PointCloud> real_scan(const BenchSettings& settings) {
  BenchSettings lidar = settings;
  lidar.files = {"small_gicp/data/source"};
  MAPCODEC_ASSIGN(const std::vector<std::string> paths, find_clouds(lidar));
  if (paths.empty()) return make_error(ErrorCode::kEmpty, settings.data + ": no small_gicp/data/source");
  MAPCODEC_ASSIGN(BenchCloud c, load_cloud(paths.front()));
  c.cloud.channels.clear();
  std::erase_if(c.cloud.xyz, [](const Vec3& p) { return p == Vec3{0, 0, 0}; });
  const PointCloud half = c.cloud;
  c.cloud.append(scan_at(half, 0.05, 1));
  return std::move(c.cloud);
}

/// Reads random tiles until told to stop. @return points per second of its own time.
double read_on(const std::string& path, const std::atomic<bool>& stop, double seconds) {
  const auto map = MapFile::open(path);
  if (!map.ok()) return 0;
  std::mt19937 random(7);
  const Watch watch(Watch::Kind::wall);
  std::uint64_t points = 0;
  while (!stop && watch.seconds() < seconds) {
    const auto cloud = map->read_tile(random() % map->archive().tiles().size());
    points += cloud.ok() ? cloud->size() : 0;
  }
  return double(points) / watch.seconds();
}

Status fill(MapUpdater& map, const PointCloud& scan, std::uint64_t points) {
  double x = 0;
  for (std::uint64_t n = 0; n < points; n += scan.size(), x += kStride) {
    MAPCODEC_TRY(map.insert(scan_at(scan, x, unsigned(n))));
  }
  const auto r = map.commit(0);
  return r.ok() ? Status{} : Status(r.error());
}

/// Peak memory of the process from now on.
void forget_peak() {
  std::ofstream("/proc/self/clear_refs") << 5;
}

/// @param which  "VmHWM:" for the peak, "VmRSS:" for what is used now.
double megabytes(const char* which) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0;
    if (word == which && status >> kilobytes) return kilobytes / 1024;
  }
  return 0;
}

struct Ingest {
  double points_per_second = 0;
  double points_per_processor_second = 0;  ///< of the whole process: other programs do not stretch it
  double peak_mb = 0, before_mb = 0;       ///< before: the scans, which wait in memory, and the program
  std::vector<double> commits;             ///< [s] from the scan to its revision on the disk
  std::uint64_t added = 0, bytes = 0;
};

/// @param period_s  0: one scan after the other; else a scan each so many seconds, as a sensor gives them.
Result<Ingest> ingest(MapUpdater& map, const PointCloud& scan, int scans, double period_s) {
  Ingest r;
  std::uint64_t points = 0;
  std::vector<PointCloud> all;
  for (int i = 0; i < scans; ++i) all.push_back(scan_at(scan, 0.5 * kStride * i, unsigned(100000 + i)));
  forget_peak();
  r.before_mb = megabytes("VmRSS:");
  const Watch watch(Watch::Kind::wall), work(Watch::Kind::whole_process);
  for (PointCloud& c : all) {
    const double early = period_s * double(r.commits.size()) - watch.seconds();
    if (early > 0) std::this_thread::sleep_for(std::chrono::duration<double>(early));
    points += c.size();
    const Watch one(Watch::Kind::wall);
    MAPCODEC_TRY(map.insert(std::move(c)));
    MAPCODEC_ASSIGN(const UpdateReport u, map.commit(0));
    r.commits.push_back(one.seconds());
    r.added += u.points_added;
    r.bytes += u.bytes;
  }
  r.points_per_second = double(points) / watch.seconds();
  r.points_per_processor_second = double(points) / work.seconds();
  r.peak_mb = megabytes("VmHWM:");
  return r;
}

void report_ingest(Report& report, const std::string& name, const Ingest& r, double reader, double solo) {
  report.row({name, digits(r.points_per_second / 1e6), digits(r.points_per_processor_second / 1e6),
              digits(r.peak_mb), digits(r.before_mb), digits(1e3 * quantile(r.commits, 0.5)),
              digits(1e3 * quantile(r.commits, 0.99)), digits(reader / 1e6),
              digits(solo > 0 ? reader / solo : 0)});
  report.json()["ingest"].push_back(Json{{"name", name},
                                         {"points_per_second", r.points_per_second},
                                         {"points_per_processor_second", r.points_per_processor_second},
                                         {"peak_mb", r.peak_mb},
                                         {"before_mb", r.before_mb},
                                         {"commit_p50_s", quantile(r.commits, 0.5)},
                                         {"commit_p99_s", quantile(r.commits, 0.99)},
                                         {"points_added", r.added},
                                         {"segment_bytes", r.bytes},
                                         {"reader_points_per_second", reader},
                                         {"reader_solo_points_per_second", solo}});
}

struct Growth {
  std::uint64_t points = 0, splits = 0, tiles = 0, largest = 0;
  std::vector<double> usual, splitting;  ///< [s] of commits
};

/// Scans of one place, every point kept: its tiles grow until they are split.
Result<Growth> grow(const std::string& path, const PointCloud& scan, const CompressOptions& o, int scans,
                    Arena& arena) {
  UpdateSettings update;
  update.density_cap = false;
  std::vector<std::string> warnings;
  CloudSource first(scan);
  MAPCODEC_ASSIGN(MapUpdater map, create_map(path, first, o, arena, update, warnings));
  Growth g;
  for (int i = 0; i < scans; ++i) {
    PointCloud c = scan_at(scan, 0, unsigned(200000 + i));
    const Watch watch(Watch::Kind::whole_process);
    MAPCODEC_TRY(map.insert(std::move(c)));
    MAPCODEC_ASSIGN(const UpdateReport u, map.commit(0));
    g.points += u.points_added;
    g.splits += u.tiles_split;
    (u.tiles_split > 0 ? g.splitting : g.usual).push_back(watch.seconds());
  }
  MAPCODEC_ASSIGN(const MapFile file, MapFile::open(path));
  g.tiles = file.archive().tiles().size();
  for (const TileRecord& t : file.archive().tiles()) g.largest = std::max(g.largest, t.points);
  return g;
}

}  // namespace

Status measure_growth(const BenchSettings& settings, Report& report) {
  MAPCODEC_ASSIGN(const PointCloud scan, real_scan(settings));
  Arena arena(settings.threads);
  report.line(fmt::format("\n## Scans of {} points into one place, every point kept\n", scan.size()));
  report.table({"promise", "M points", "tiles", "largest tile, M points", "splits",
                "commit ms of processor p50", "those that split p50", "most"});
  for (const PromiseKind promise : {PromiseKind::max_error, PromiseKind::rms}) {
    settings.say(fmt::format("tiles that grow, {}", promise_name(promise)));
    CompressOptions o;
    o.promise = promise;
    o.promise_m = kPromise;
    o.overwrite = true;
    MAPCODEC_ASSIGN(const Growth g, grow(report.scratch(), scan, o, settings.quick ? 30 : 60, arena));
    report.row({promise_name(promise), digits(double(g.points) / 1e6), std::to_string(g.tiles),
                digits(double(g.largest) / 1e6), std::to_string(g.splits),
                digits(1e3 * quantile(g.usual, 0.5)), digits(1e3 * quantile(g.splitting, 0.5)),
                digits(1e3 * quantile(g.splitting, 1))});
    report.json()["growth"].push_back(Json{{"promise", promise_name(promise)},
                                           {"points", g.points},
                                           {"tiles", g.tiles},
                                           {"largest_tile", g.largest},
                                           {"splits", g.splits},
                                           {"commit_processor_s", quantile(g.usual, 0.5)},
                                           {"splitting_commit_processor_s", quantile(g.splitting, 0.5)},
                                           {"slowest_splitting_commit_s", quantile(g.splitting, 1)}});
  }
  return {};
}

Status measure_ingest(const BenchSettings& settings, Report& report) {
  const std::uint64_t size = settings.quick ? 5'000'000 : 50'000'000;
  MAPCODEC_ASSIGN(const PointCloud scan, real_scan(settings));
  Arena arena(settings.threads);
  CompressOptions o;
  o.promise = PromiseKind::max_error;
  o.promise_m = kPromise;
  o.overwrite = true;
  std::vector<std::string> warnings;
  CloudSource first(scan);
  UpdateSettings update;
  update.density_cap = false;
  settings.say(fmt::format("a map of {} points", size));
  {
    MAPCODEC_ASSIGN(MapUpdater map, create_map(report.scratch(), first, o, arena, update, warnings));
    MAPCODEC_TRY(fill(map, scan, size));
  }
  const std::atomic<bool> never = false;
  settings.say("reading alone");
  const double solo = read_on(report.scratch(), never, 5);
  report.line(
      fmt::format("\n## Scans of {} points into a map of {} million\n", scan.size(), size / 1'000'000));
  report.line(fmt::format("Budget of the updater: {} MB for what it knows of tiles, {} points in a batch.\n",
                          update.cache_bytes >> 20, update.batch_points));
  report.table({"", "M points/s", "per processor s", "peak MB", "MB before", "commit ms p50", "p99",
                "reader M points/s", "of alone"});
  const int scans = settings.quick ? 30 : 150;
  update.density_cap = true;
  for (const bool with_reader : {false, true}) {
    settings.say(with_reader ? "writing, with a reader" : "writing alone");
    MAPCODEC_ASSIGN(MapUpdater map, MapUpdater::open(report.scratch(), arena, update));
    std::atomic<bool> stop = false;
    double reader = 0;
    std::thread reading([&] { reader = with_reader ? read_on(report.scratch(), stop, 1e9) : 0; });
    const auto r = ingest(map, scan, scans, with_reader ? kPeriod : 0);
    stop = true;
    reading.join();
    if (!r.ok()) return r.error();
    report_ingest(report, with_reader ? "at 10 Hz, with a reader" : "as fast as it goes", *r, reader, solo);
  }
  return {};
}

}  // namespace mapcodec::bench
