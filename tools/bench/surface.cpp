// SPDX-License-Identifier: GPL-3.0-or-later
// The choice between surfaces and points at promises around each cloud's spacing, and the figures that the
// surface codec is built for.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "mapcodec/quality/evaluation.hpp"
#include "mapcodec/quality/grid_nearest.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/tile_sample.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/codec_run.hpp"
#include "tools/bench/report.hpp"

namespace mapcodec {
namespace {

using bench::BenchCloud;
using bench::digits;
using bench::Json;

constexpr std::size_t kFewestPoints = 50000;
const std::vector<double> kSpacings{0.5, 1, 2, 4};
const std::vector<double> kQuickSpacings{1, 4};
/// Mixing may cost this much more than the better of both alone: one flag per tile, and the search's
/// tolerance.
constexpr double kTieShare = 1.02;

struct Mode {
  const char* name;
  CodecChoice codecs;
};
constexpr Mode kModes[] = {
    {"surface", CodecChoice::surface}, {"points", CodecChoice::points}, {"auto", CodecChoice::cheapest}};

/// What a row of the surface codec's own table asks for; 0: nothing.
struct Goal {
  const char* part;  ///< of the path
  double rms_m, bits, density;
  bool without_duplicates = false, with_color = false;
};
constexpr Goal kGoals[] = {{"region_growing_rgb_tutorial", 0.005, 0.100, 0.10},
                           {"region_growing_rgb_tutorial", 0.0085, 0.038, 0.19},
                           {"scan000.3d", 0.0085, 3.1, 0.18},
                           {"room_scan1.pcd", 0.0085, 4.5, 0.18, true},
                           {"crop_full_density", 0.012, 1.0, 0.25, false, true},
                           {"learn13", 0.002, 0.033, 0.10},
                           {"learn13", 0.005, 0.016, 0.15},
                           {"tum_fr2_pioneer_slam2", 0.005, 0, 0.25},
                           {"tum_fr2_pioneer_slam2", 0.010, 0, 0.25},
                           {"crop_full_density", 0.002, 0, 0}};

struct Row {
  std::string codec;
  double promise_m = 0, bits = 0, channel_bits = 0, rms_m = 0, density = 0, color = 0, ratio = 0;
  double surface_share = 0, encode_mpps = 0, decode_mpps = 0, seconds = 0;
  double farthest_m = 0, stated_m = 0;  ///< of an original point to the decoded cloud
  std::uint64_t tiles = 0;
  int codings = 0;
  bool kept = false, count_kept = false, near = false;
};

/// An original point may lie this many promises off, or as far as the archive says.
constexpr double kFarPromises = 10;

double farthest_of(const PointCloud& cloud, const PointCloud& decoded) {
  const GridNearest index(decoded.xyz);
  const Nearest nearest = index.find(cloud.xyz, GridNearest(cloud.xyz).order());
  return std::sqrt(*std::max_element(nearest.squared.begin(), nearest.squared.end()));
}

PointCloud unique_points(const PointCloud& cloud) {
  std::vector<std::uint32_t> order(cloud.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<std::uint32_t>(i);
  const auto less = [&](std::uint32_t a, std::uint32_t b) { return cloud.xyz[a] < cloud.xyz[b]; };
  const auto same = [&](std::uint32_t a, std::uint32_t b) { return cloud.xyz[a] == cloud.xyz[b]; };
  std::sort(order.begin(), order.end(), less);
  order.erase(std::unique(order.begin(), order.end(), same), order.end());
  return cloud.gather(order);
}

double million_per_second(std::size_t points, double seconds) {
  return seconds > 0 ? static_cast<double>(points) / seconds / 1e6 : std::nan("");
}

/// Measures, and keeps table and JSON.
class SurfaceBench {
 public:
  SurfaceBench(const BenchSettings& settings, bench::Report& report, Runner& runner)
      : settings_(settings), report_(report), runner_(runner) {}

  Result<Row> measure(const PointCloud& cloud, const Mode& mode, double rms_m, bool channels) {
    CompressOptions o;
    o.channels = {channels ? "all" : "none"};
    o.threads = 1;
    o.codecs = mode.codecs;
    o.promise_m = rms_m;
    if (channels) o.color_error = 12;
    MAPCODEC_ASSIGN(const bench::CodecRun run, bench::run_codec(cloud, o, report_.scratch()));
    EvaluationSettings e;
    e.with_normals = false;
    MAPCODEC_ASSIGN(const Evaluation v, evaluate(cloud, run.decoded, runner_, e));
    const auto n = static_cast<double>(cloud.size());
    Row r;
    r.codec = mode.name;
    r.promise_m = rms_m;
    r.bits = 8 * static_cast<double>(run.report.geometry_bytes) / n;
    r.channel_bits = 8 * static_cast<double>(run.archive_bytes - run.report.geometry_bytes) / n;
    r.ratio = static_cast<double>(run.archive_bytes) / static_cast<double>(run.raw_bytes);
    r.rms_m = v.rms_m;
    r.density = v.density_error;
    r.color = v.color_error;
    r.kept = v.rms_m <= rms_m;
    r.count_kept = run.decoded.size() == cloud.size();
    r.farthest_m = farthest_of(cloud, run.decoded);
    r.stated_m = run.stated_farthest_m;
    r.near = r.farthest_m <= std::max(kFarPromises * rms_m, r.stated_m);
    r.surface_share = run.surface_share;
    r.tiles = run.tile_decode_seconds.size();
    r.codings = run.report.codings;
    r.seconds = run.report.seconds;
    r.encode_mpps = million_per_second(cloud.size(), run.encode_seconds);
    r.decode_mpps = million_per_second(cloud.size(), run.decode_seconds);
    return r;
  }

  void show_head(const std::string& what) {
    print("");
    print(what);
    print(fmt::format("{:>8} {:>8} {:>8} {:>8} {:>5} {:>7} {:>8} {:>5} {:>8} {:>7} {:>7} {:>6}", "RMS mm",
                      "codec", "bits", "got mm", "kept", "density", "farthest", "tiles", "surface", "enc M/s",
                      "dec M/s", "codings"));
  }
  void show(const Row& r, const std::string& remark) {
    print(fmt::format("{:>8} {:>8} {:>8} {:>8} {:>5} {:>7} {:>8} {:>5} {:>7.0f}% {:>7} {:>7} {:>6} {}",
                      digits(r.promise_m * 1e3), r.codec, digits(r.bits), digits(r.rms_m * 1e3),
                      r.kept && r.count_kept && r.near ? "yes" : "NO", digits(r.density),
                      digits(r.farthest_m * 1e3), r.tiles, 100 * r.surface_share, digits(r.encode_mpps),
                      digits(r.decode_mpps), r.codings, remark));
  }
  static Json json(const Row& r) {
    return {{"codec", r.codec},
            {"promise_m", r.promise_m},
            {"bits_per_point", r.bits},
            {"other_bits_per_point", r.channel_bits},
            {"ratio", r.ratio},
            {"rms_m", r.rms_m},
            {"promise_kept", r.kept},
            {"count_kept", r.count_kept},
            {"farthest_m", r.farthest_m},
            {"stated_farthest_m", r.stated_m},
            {"density_error", r.density},
            {"color_error", std::isfinite(r.color) ? Json(r.color) : Json(nullptr)},
            {"surface_share", r.surface_share},
            {"tiles", r.tiles},
            {"codings", r.codings},
            {"seconds", r.seconds},
            {"encode_mpoints_per_s", r.encode_mpps},
            {"decode_mpoints_per_s", r.decode_mpps}};
  }
  void print(const std::string& text) {
    settings_.print(text);
    report_.line(text.empty() ? text : "    " + text);
  }
  void fail(const std::string& what, const Error& e) { report_.note(what + ": " + e.to_string()); }

  /// The three modes at promises around the spacing.
  void sweep(const BenchCloud& c) {
    const double spacing = mean_spacing(c.cloud.xyz);
    if (!(spacing > 0)) return;
    show_head(fmt::format("{} ({} points, {} mm apart)", c.name, c.cloud.size(), digits(spacing * 1e3)));
    Json entry{
        {"cloud", c.name}, {"points", c.cloud.size()}, {"spacing_m", spacing}, {"rows", Json::array()}};
    for (const double r : settings_.quick ? kQuickSpacings : kSpacings) {
      double best = INFINITY;
      for (const Mode& mode : kModes) {
        const auto row = measure(c.cloud, mode, r * spacing, false);
        if (!row.ok()) {
          fail(fmt::format("{}, {} at {} mm", c.name, mode.name, digits(r * spacing * 1e3)), row.error());
          continue;
        }
        const bool chosen = mode.codecs == CodecChoice::cheapest;
        show(*row, chosen && row->bits > kTieShare * best ? "dear" : "");
        best = std::min(best, row->bits);
        entry["rows"].push_back(json(*row));
      }
    }
    report_.json()["clouds"].push_back(std::move(entry));
  }

  void reach(const Goal& goal, const BenchCloud& c) {
    const PointCloud cloud = goal.without_duplicates ? unique_points(c.cloud) : c.cloud;
    show_head(fmt::format("{} ({} points): bits at most {}, density error at most {}", c.name, cloud.size(),
                          goal.bits > 0 ? digits(goal.bits) : "-",
                          goal.density > 0 ? digits(goal.density) : "-"));
    const auto row = measure(cloud, kModes[2], goal.rms_m, goal.with_color);
    if (!row.ok()) return fail(c.name, row.error());
    const bool reached = row->kept && row->count_kept && (goal.bits == 0 || row->bits <= goal.bits) &&
                         (goal.density == 0 || row->density <= goal.density);
    show(*row, reached ? "reached" : "MISSED");
    if (goal.with_color) {
      print(fmt::format("{:>17} {} further bits, colour error {}, ratio {}", "", digits(row->channel_bits),
                        digits(row->color), digits(row->ratio)));
    }
    Json entry = json(*row);
    entry["cloud"] = c.name;
    entry["goal_bits"] = goal.bits;
    entry["goal_density"] = goal.density;
    entry["reached"] = reached;
    report_.json()["goals"].push_back(std::move(entry));
  }

 private:
  const BenchSettings& settings_;
  bench::Report& report_;
  Runner& runner_;
};

}  // namespace

Status bench_surface(const BenchSettings& settings) {
  Arena arena(settings.threads);
  TbbRunner runner(arena);
  bench::Report report(settings, "surface", 1);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_ASSIGN(const std::vector<std::string> paths, bench::find_clouds(settings));
  SurfaceBench b(settings, report, runner);
  for (const std::string& path : paths) {
    const Result<BenchCloud> c = bench::load_cloud(path);
    if (!c.ok() || c->cloud.empty()) continue;
    for (const Goal& goal : kGoals) {
      if (path.find(goal.part) == std::string::npos) continue;
      settings.say(fmt::format("{}: {} mm", c->name, digits(goal.rms_m * 1e3)));
      b.reach(goal, *c);
    }
    if (settings.goals_alone || c->cloud.size() < kFewestPoints) continue;
    settings.say(c->name + ": surface, points, auto");
    b.sweep(*c);
  }
  return report.finish();
}

}  // namespace mapcodec
