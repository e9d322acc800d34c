// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>

#include "slam_adapter/client/map_replica.hpp"
#include "slam_adapter/client/scan_sender.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/service.hpp"

namespace mapcodec::bench {
namespace {

constexpr double kPromise = 0.02;  // [m] max_error

Result<PointCloud> real_scan(const BenchSettings& settings) {
  BenchSettings lidar = settings;
  lidar.files = {"small_gicp/data/source"};
  MAPCODEC_ASSIGN(const std::vector<std::string> paths, find_clouds(lidar));
  if (paths.empty()) return make_error(ErrorCode::kEmpty, settings.data + ": no small_gicp/data/source");
  MAPCODEC_ASSIGN(BenchCloud c, load_cloud(paths.front()));
  c.cloud.channels.clear();
  std::erase_if(c.cloud.xyz, [](const Vec3& p) { return p == Vec3{0, 0, 0}; });
  c.cloud.coordinates = {};
  return std::move(c.cloud);
}

Status create(const ChildDaemon& daemon, const std::string& map, const PointCloud& scan) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(daemon.url(map)));
  NewMap m;
  m.promise = PromiseKind::max_error;
  m.promise_m = kPromise;
  m.sample = scan;
  return client.create(m);
}

Json json_of(const LoadResult& r) {
  return {{"seconds", r.seconds},
          {"points_per_second", r.points_per_second},
          {"revisions", r.revisions},
          {"tiles_read", r.tiles_read},
          {"bytes_read", r.bytes_read},
          {"daemon_cores", r.daemon_cores},
          {"wait_p50_s", quantile(r.waits_s, 0.5)},
          {"wait_p99_s", quantile(r.waits_s, 0.99)},
          {"resident_mb_first", r.resident_mb.empty() ? 0 : r.resident_mb.front()},
          {"resident_mb_peak", quantile(r.resident_mb, 1)},
          {"resident_mb_last", r.resident_mb.empty() ? 0 : r.resident_mb.back()},
          {"faults", r.faults}};
}

void row_of(Report& report, const std::string& name, const LoadResult& r) {
  report.row({name, digits(r.seconds), digits(r.points_per_second / 1e6),
              digits(double(r.revisions) / r.seconds), digits(1e3 * quantile(r.waits_s, 0.5)),
              digits(1e3 * quantile(r.waits_s, 0.99)), digits(double(r.tiles_read) / r.seconds),
              digits(double(r.bytes_read) / r.seconds / 1e6), digits(r.daemon_cores),
              digits(quantile(r.resident_mb, 1)), std::to_string(r.faults.size())});
}

const std::vector<std::string> kHead{
    "load",         "s",    "M points/s",      "commits/s", "wait ms p50", "p99",
    "tiles/s read", "MB/s", "cores of daemon", "peak MB",   "faults"};

Status measure_load(const BenchSettings& settings, const PointCloud& scan, Report& report) {
  report.line(fmt::format("\n## Scans of {} points, max_error {} m\n", scan.size(), kPromise));
  report.table(kHead);
  const std::string folder = report.scratch() + ".daemon";
  for (const int readers : {0, 8}) {
    settings.say(fmt::format("4 writers, {} readers", readers));
    MAPCODEC_ASSIGN(ChildDaemon daemon, ChildDaemon::start(folder));
    MAPCODEC_TRY(create(daemon, "m", scan));
    LoadSettings load;
    load.readers = readers;
    load.seconds = settings.quick ? 10 : 40;
    MAPCODEC_ASSIGN(const LoadResult r, run_load(daemon, "m", scan, load));
    row_of(report, fmt::format("4 writers, {} readers", readers), r);
    report.json()["load"].push_back(json_of(r));
    if (!daemon.stop()) report.note("mapcodecd did not end in order");
  }
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  return {};
}

/// Memory, and the map that it is for, in parts of the time.
void report_parts(Report& report, const LoadResult& r) {
  report.line(
      "\n| part of the soak | MB, least | MB, median | MB, most | MB of cache | M points in the map | MB of "
      "archive |\n|---|---|---|---|---|---|---|");
  constexpr std::size_t kParts = 6;
  for (std::size_t part = 0; part < kParts; ++part) {
    const auto share = [&](const std::vector<double>& values, double q) {
      const auto at = [&](std::size_t k) {
        return values.begin() + std::ptrdiff_t(values.size() * k / kParts);
      };
      const std::vector<double> some(at(part), at(part + 1));
      return some.empty() ? 0.0 : quantile(some, q);
    };
    const double least = share(r.resident_mb, 0), middle = share(r.resident_mb, 0.5),
                 most = share(r.resident_mb, 1), points = share(r.stored_points, 0.5),
                 archive = share(r.archive_mb, 0.5), cached = share(r.cache_mb, 0.5);
    report.row({fmt::format("{} of {}", part + 1, kParts), digits(least), digits(middle), digits(most),
                digits(cached), digits(points / 1e6), digits(archive)});
    report.json()["soak"]["parts"].push_back({{"least_mb", least},
                                              {"median_mb", middle},
                                              {"most_mb", most},
                                              {"cache_mb", cached},
                                              {"points", points},
                                              {"archive_mb", archive}});
  }
}

// Less than the usual budget, which takes half an hour to fill: what a daemon needs beside it is to be seen.
constexpr const char* kSoakConfig = "[storage]\ncache_bytes = 33554432\n";

/// Mixed load for minutes over places that come again: the map, and memory, should stay as they are.
Status measure_soak(const BenchSettings& settings, const PointCloud& scan, Report& report) {
  const std::string folder = report.scratch() + ".daemon";
  MAPCODEC_ASSIGN(ChildDaemon daemon, ChildDaemon::start(folder, kSoakConfig));
  MAPCODEC_TRY(create(daemon, "m", scan));
  LoadSettings load;
  load.seconds = settings.quick ? 20 : settings.minutes * 60;
  load.scans_per_second = 1;
  load.fetches_per_second = 2;
  load.same_places = true;
  settings.say(fmt::format("mixed load for {:.0f} s", load.seconds));
  MAPCODEC_ASSIGN(const LoadResult r, run_load(daemon, "m", scan, load));
  report.line("\n## Mixed load over minutes\n");
  report.table(kHead);
  row_of(report, "4 writers at 1 Hz, 8 readers at 2 Hz", r);
  report.json()["soak"] = json_of(r);
  report_parts(report, r);
  Plot plot;
  plot.title = "resident memory of mapcodecd";
  plot.x_label = "s";
  plot.y_label = "MB";
  plot.series.push_back({"RSS", {}, true});
  for (std::size_t i = 0; i < r.resident_mb.size(); ++i)
    plot.series.back().points.emplace_back(double(i), r.resident_mb[i]);
  MAPCODEC_TRY(report.plot({plot}, "soak"));
  if (!daemon.stop()) report.note("mapcodecd did not end in order");
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  return {};
}

}  // namespace

Status measure_sync(const BenchSettings& settings, const PointCloud& scan, Report& report) {
  settings.say("a copy that follows");
  const std::string folder = report.scratch() + ".daemon";
  MAPCODEC_ASSIGN(ChildDaemon daemon, ChildDaemon::start(folder));
  MAPCODEC_TRY(create(daemon, "m", scan));
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(daemon.url("m")));
  const auto drive = [&](double begin, int scans) -> Status {
    MAPCODEC_ASSIGN(const auto sender, ScanSender::open(client, {}));
    for (int i = 0; i < scans; ++i) {
      Scan message;
      message.points = scan;
      message.T_submap_scan = PoseChange{0, {begin + 3.0 * i, 0, 0}, {0, 0, 0, 1}};
      MAPCODEC_TRY(sender->send(std::move(message)));
    }
    MAPCODEC_TRY(sender->finish());
    return {};
  };
  report.line("\n## A copy that is brought up to date\n");
  report.table({"after", "tiles fetched", "kB fetched", "kB whole", "share"});
  MAPCODEC_ASSIGN(MapReplica copy, MapReplica::open(client, folder + "/copy.mapc"));
  const auto step = [&](const std::string& name) -> Status {
    MAPCODEC_ASSIGN(const ReplicaReport r, copy.catch_up());
    report.row({name, std::to_string(r.tiles_fetched), digits(1e-3 * double(r.bytes_fetched), 4),
                digits(1e-3 * double(r.bytes_whole), 4),
                digits(double(r.bytes_fetched) / double(r.bytes_whole))});
    report.json()["sync"].push_back({{"after", name},
                                     {"bytes_fetched", r.bytes_fetched},
                                     {"bytes_whole", r.bytes_whole},
                                     {"tiles_fetched", r.tiles_fetched}});
    return {};
  };
  MAPCODEC_TRY(drive(0, settings.quick ? 20 : 100));
  MAPCODEC_TRY(step("the whole drive"));
  MAPCODEC_TRY(drive(1.5, 1));
  MAPCODEC_TRY(step("one scan more"));
  MAPCODEC_TRY(drive(2.5, 5));
  MAPCODEC_TRY(step("five scans more"));
  if (!daemon.stop()) report.note("mapcodecd did not end in order");
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
  return {};
}

}  // namespace mapcodec::bench

namespace mapcodec {

Status bench_service(const BenchSettings& settings) {
  bench::Report report(settings, "service", settings.threads);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_ASSIGN(const PointCloud scan, bench::real_scan(settings));
  const auto wanted = [&](const char* part) {
    const auto& only = settings.files;
    return only.empty() || std::find(only.begin(), only.end(), part) != only.end();
  };
  if (wanted("fetch")) MAPCODEC_TRY(bench::measure_fetch(settings, report));
  if (wanted("sync")) MAPCODEC_TRY(bench::measure_sync(settings, scan, report));
  if (wanted("load")) MAPCODEC_TRY(bench::measure_load(settings, scan, report));
  if (wanted("soak")) MAPCODEC_TRY(bench::measure_soak(settings, scan, report));
  return report.finish();
}

}  // namespace mapcodec
