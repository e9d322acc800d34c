// SPDX-License-Identifier: GPL-3.0-or-later
// The map around a robot: how fast a tile comes, whether a drive ever waits, and what compression does to
// localisation.
#include "tools/bench/local.hpp"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <thread>

#include "mapcodec/cloud/cloud_source.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/local_map.hpp"

namespace mapcodec::bench {
namespace {

namespace fs = std::filesystem;

constexpr double kPi = 3.14159265358979323846;
constexpr const char* kTileCloud = "hku_mlcc_scene2_360_rgb_1of8.pcd";
constexpr const char* kDriveScan = "small_gicp/data/target.ply";
constexpr double kDriveLength = 200, kDriveSpeed = 10, kDriveRadius = 50, kScanEvery = 2, kPeriod = 0.1;

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

/// Takes the file out of the page cache.
void make_cold(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return;
  ::fdatasync(file);
  ::posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED);
  ::close(file);
}

struct Mode {
  const char* name;
  PromiseKind promise;
  double promise_m;
};
constexpr Mode kModes[] = {{"--max-error 0.005", PromiseKind::max_error, 0.005},
                           {"--rms 0.01", PromiseKind::rms, 0.01}};

struct TileTimes {
  std::vector<double> cold, warm, fetch, index;  // [ms]; cold and warm: fetch and decode
  std::vector<double> points;
};

Result<TileTimes> time_tiles(const std::string& path) {
  MAPCODEC_ASSIGN(const MapArchive archive, MapArchive::open(path));
  MAPCODEC_ASSIGN(const MapSchema schema, read_schema(archive.info().schema));
  TileTimes t;
  for (const TileRecord& tile : archive.tiles()) {
    if (tile.points < 50'000 || tile.points > 200'000 || tile.segments.size() != 1) continue;
    make_cold(path);
    for (int run = 0; run < 4; ++run) {
      const double begin = wall_s();
      MAPCODEC_ASSIGN(const Bytes bytes, archive.read(tile.segments[0]));
      const double fetched = wall_s();
      MAPCODEC_ASSIGN(const PointCloud points, decode_tile(bytes, schema));
      const double done = wall_s();
      (run == 0 ? t.cold : t.warm).push_back(1e3 * (done - begin));
      if (run == 0) t.fetch.push_back(1e3 * (fetched - begin));
    }
    LocalContent content;
    const auto budget = std::make_shared<MemoryBudget>(std::uint64_t{1} << 32);
    const double begin = wall_s();
    MAPCODEC_ASSIGN(const auto loaded,
                    load_local_tile(archive, schema, tile, content, std::nullopt, {},
                                    Reservation::of(budget, bytes_to_load(tile, schema, content, false))));
    t.index.push_back(1e3 * (wall_s() - begin));
    t.points.push_back(static_cast<double>(loaded->points.size()));
  }
  return t;
}

Status bench_tiles(LocalBench& b) {
  MAPCODEC_ASSIGN(const BenchCloud cloud, load_named(b.settings, kTileCloud));
  b.print(fmt::format("Tiles of {}, fetch and decode on one core [ms]", cloud.name));
  b.print(fmt::format("{:>18} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>10} {:>14}", "map", "tiles", "points",
                      "warm p50", "warm p99", "cold p50", "cold p99", "fetch p99", "with index p50"));
  for (const Mode& mode : kModes) {
    b.settings.say(fmt::format("tiles of {}", mode.name));
    CompressOptions o;
    o.promise = mode.promise;
    o.promise_m = mode.promise_m;
    o.overwrite = true;
    o.channels = {"none"};
    o.codecs = CodecChoice::points;  // the codec with tiles of 100,000 points
    o.threads = b.arena.threads();
    CloudSource source(cloud.cloud);
    MAPCODEC_ASSIGN(const CompressReport done, compress(source, b.report.scratch(), o));
    MAPCODEC_ASSIGN(const TileTimes t, time_tiles(b.report.scratch()));
    b.print(fmt::format("{:>18} {:>6} {:>9.0f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>10.2f} {:>14.2f}",
                        mode.name, t.points.size(), percentile(t.points, 0.5), percentile(t.warm, 0.5),
                        percentile(t.warm, 0.99), percentile(t.cold, 0.5), percentile(t.cold, 0.99),
                        percentile(t.fetch, 0.99), percentile(t.index, 0.5)));
    b.report.json()["tiles"].push_back({{"cloud", cloud.name},
                                        {"map", mode.name},
                                        {"tiles", t.points.size()},
                                        {"points_p50", percentile(t.points, 0.5)},
                                        {"warm_p50_ms", percentile(t.warm, 0.5)},
                                        {"warm_p99_ms", percentile(t.warm, 0.99)},
                                        {"cold_p50_ms", percentile(t.cold, 0.5)},
                                        {"cold_p99_ms", percentile(t.cold, 0.99)},
                                        {"fetch_cold_p99_ms", percentile(t.fetch, 0.99)},
                                        {"load_with_index_p50_ms", percentile(t.index, 0.5)}});
  }
  return {};
}

/// A scan again and again along x, turned a little each time: a drive whose every place differs.
class ReplicatedScan final : public PointSource {
 public:
  ReplicatedScan(const PointCloud& scan, std::size_t copies)
      : scan_(scan), copies_(copies), layout_(scan.like()) {}
  const PointCloud& layout() const override { return layout_; }
  std::optional<std::uint64_t> announced_points() const override { return scan_.size() * copies_; }
  Result<bool> next(PointCloud& block) override {
    block = layout_;
    if (at_ == copies_) return false;
    const double angle = kPi * static_cast<double>(at_ % 16) / 8, c = std::cos(angle), s = std::sin(angle);
    const double x = kScanEvery * static_cast<double>(at_++);
    for (const Vec3& p : scan_.xyz)
      block.xyz.push_back({double(float(x + c * p[0] - s * p[1])), double(float(s * p[0] + c * p[1])), p[2]});
    return true;
  }
  Status rewind() override {
    at_ = 0;
    return {};
  }
  std::uint64_t dropped_points() const override { return 0; }

 private:
  const PointCloud& scan_;
  std::size_t copies_, at_ = 0;
  PointCloud layout_;
};

struct Drive {
  std::size_t steps = 0, at_once = 0, in_time = 0;
  double longest_call_ms = 0, first_ms = 0;
  std::uint64_t peak = 0, most_points = 0;
};

/// @param hurry  how much faster than real time.
Result<Drive> drive(const std::string& path, std::uint64_t budget, double hurry, Arena& arena) {
  LocalMapSettings s;
  s.radius_m = kDriveRadius;
  s.memory_bytes = budget;
  make_cold(path);
  const double opened = wall_s();
  MAPCODEC_ASSIGN(const std::unique_ptr<LocalMap> map, LocalMap::open(path, s, arena));
  MAPCODEC_TRY(map->move_to({}, 0.0));
  MAPCODEC_ASSIGN(const bool loaded, map->wait_ready(60));
  if (!loaded) return make_error(ErrorCode::kCancelled, "the first place was not loaded in a minute");
  Drive d;
  d.first_ms = 1e3 * (wall_s() - opened);
  const double begin = wall_s();
  for (double t = 0; t * kDriveSpeed < kDriveLength; t += kPeriod, ++d.steps) {
    const double due = begin + t / hurry;
    std::this_thread::sleep_for(std::chrono::duration<double>(std::max(0.0, due - wall_s())));
    const double call = wall_s();
    MAPCODEC_TRY(map->move_to({{t * kDriveSpeed, 0, 0}, {0, 0, 0, 1}}, t));
    d.longest_call_ms = std::max(d.longest_call_ms, 1e3 * (wall_s() - call));
    MAPCODEC_ASSIGN(const bool at_once, map->wait_ready(0.01 / hurry));
    MAPCODEC_ASSIGN(const bool in_time, map->wait_ready(due + kPeriod / hurry - wall_s()));
    d.at_once += at_once ? 1U : 0U;
    d.in_time += in_time ? 1U : 0U;
    d.most_points = std::max<std::uint64_t>(d.most_points, map->view()->points());
  }
  d.peak = map->memory().peak;
  return d;
}

Status bench_drive(LocalBench& b) {
  MAPCODEC_ASSIGN(BenchCloud scan, load_named(b.settings, kDriveScan));
  scan.cloud.channels.clear();
  const auto copies = static_cast<std::size_t>(kDriveLength / kScanEvery) + 1;
  b.settings.say(fmt::format("a drive: {} copies of {}", copies, scan.name));
  CompressOptions o;
  o.promise = PromiseKind::max_error;
  o.promise_m = 0.005;
  o.overwrite = true;
  o.effort = Effort::fast;
  o.threads = b.arena.threads();
  ReplicatedScan source(scan.cloud, copies);
  MAPCODEC_ASSIGN(const CompressReport made, compress(source, b.report.scratch(), o));
  const double hurry = b.settings.quick ? 4 : 1;
  b.print("");
  b.print(fmt::format("{} m at {} m/s, {} m around, {} points in all, {} x real time", kDriveLength,
                      kDriveSpeed, kDriveRadius, made.points, hurry));
  b.print(fmt::format("{:>10} {:>6} {:>12} {:>12} {:>10} {:>12} {:>10} {:>11}", "budget MB", "steps",
                      "ready 10 ms", "ready 100 ms", "peak MB", "most points", "first ms", "longest ms"));
  for (const std::uint64_t megabytes : {std::uint64_t{128}, std::uint64_t{192}, std::uint64_t{512}}) {
    const auto d = drive(b.report.scratch(), megabytes * 1'000'000, hurry, b.arena);
    if (!d.ok()) {
      b.print(fmt::format("{:>10} {}", megabytes, d.error().message));
      continue;
    }
    const auto share = [&](std::size_t n) { return 100.0 * double(n) / double(d->steps); };
    b.print(fmt::format("{:>10} {:>6} {:>11.1f}% {:>11.1f}% {:>10.1f} {:>12} {:>10.0f} {:>11.2f}", megabytes,
                        d->steps, share(d->at_once), share(d->in_time), double(d->peak) / 1e6, d->most_points,
                        d->first_ms, d->longest_call_ms));
    b.report.json()["drive"].push_back({{"budget_bytes", megabytes * 1'000'000},
                                        {"steps", d->steps},
                                        {"ready_within_10ms", share(d->at_once)},
                                        {"ready_within_period", share(d->in_time)},
                                        {"peak_bytes", d->peak},
                                        {"most_points", d->most_points},
                                        {"times_real_time", hurry},
                                        {"first_place_ms", d->first_ms},
                                        {"longest_move_to_ms", d->longest_call_ms}});
  }
  return {};
}

}  // namespace

double wall_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::uint64_t file_bytes(const std::string& path) {
  std::error_code failed;
  const std::uintmax_t size = fs::file_size(path, failed);
  return failed ? 0 : size;
}

Result<BenchCloud> load_named(const BenchSettings& settings, const std::string& part) {
  MAPCODEC_ASSIGN(const std::string path, path_named(settings, part));
  return load_cloud(path);
}

Result<std::string> path_named(const BenchSettings& settings, const std::string& part) {
  std::error_code failed;
  fs::recursive_directory_iterator it(settings.data, failed);
  if (failed) return make_error(ErrorCode::kNotFound, settings.data + ": " + failed.message());
  for (const fs::directory_entry& entry : it) {
    if (entry.path().generic_string().ends_with(part)) return entry.path().string();
  }
  return make_error(ErrorCode::kNotFound, settings.data + " has no " + part);
}

}  // namespace mapcodec::bench

namespace mapcodec {

Status bench_local(const BenchSettings& settings) {
  Arena arena(settings.threads);
  bench::Report report(settings, "local", arena.threads());
  MAPCODEC_TRY(report.begin());
  bench::LocalBench b{settings, report, arena};
  const auto wanted = [&](const char* part) {
    const std::vector<std::string>& only = settings.files;
    return only.empty() || std::find(only.begin(), only.end(), part) != only.end();
  };
  // A folder without one part's clouds still has the others measured.
  const auto measured = [&](const Status& s) {
    if (!s.ok()) report.note(s.error().message);
    return s.ok() || s.error().code == ErrorCode::kNotFound ? Status{} : s;
  };
  if (wanted("tiles")) MAPCODEC_TRY(measured(bench::bench_tiles(b)));
  if (wanted("drive")) MAPCODEC_TRY(measured(bench::bench_drive(b)));
  MAPCODEC_TRY(measured(bench::bench_localisation(b)));
  std::error_code ignored;
  std::filesystem::remove(report.scratch(), ignored);
  return report.finish();
}

}  // namespace mapcodec
