// SPDX-License-Identifier: GPL-3.0-or-later
// What cutting a map into tiles costs surfaces, in bits and in error near the borders.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "mapcodec/quality/grid_nearest.hpp"
#include "slam_adapter/tile_sample.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/codec_run.hpp"
#include "tools/bench/report.hpp"

namespace mapcodec {
namespace {

using bench::BenchCloud;
using bench::CodecRun;
using bench::digits;
using bench::Json;

constexpr std::size_t kFewestPoints = 50000;
const std::vector<double> kSpacings{1, 2, 4}, kQuickSpacings{2};
constexpr double kNearSpacings = 3;  // of a border: as far as a leaf there reaches that was cut

/// Squared distances of points near a border between tiles, and of the others.
struct Split {
  double near = 0, inside = 0;
  std::size_t near_points = 0, inside_points = 0;

  void add(std::span<const Vec3> points, const Nearest& nearest, const CodecRun& run, double reach_m) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      bool is_near = false;
      for (std::size_t d = 0; d < 3; ++d) {
        const double tiles = (points[i][d] - run.origin[d]) / run.tile_size_m;
        is_near = is_near || std::abs(tiles - std::round(tiles)) * run.tile_size_m < reach_m;
      }
      (is_near ? near : inside) += nearest.squared[i];
      ++(is_near ? near_points : inside_points);
    }
  }
  [[nodiscard]] double ratio() const {
    if (near_points == 0 || inside_points == 0) return std::nan("");
    return std::sqrt(near / double(near_points) / (inside / double(inside_points)));
  }
};

struct Cut {
  std::uint64_t tiles = 0;
  double tile_size_m = 0, bits = 0, rms_m = 0, forth = 0,
         back = 0;  ///< the last two: RMS near borders / inside
};

/// At one promise; bits_at_equal_rms puts right by how much it is kept differently.
Result<Cut> measure(const PointCloud& cloud, double rms_m, double tile_size_m, double spacing_m,
                    const std::string& scratch) {
  CompressOptions o;
  o.channels = {"none"};
  o.codecs = CodecChoice::surface;
  o.promise_m = rms_m;
  o.tile_size_m = tile_size_m;
  MAPCODEC_ASSIGN(const CodecRun run, bench::run_codec(cloud, o, scratch));
  const NearestPair near = find_nearest_pair(cloud.xyz, run.decoded.xyz);
  Split forth, back;
  forth.add(cloud.xyz, near.forth, run, kNearSpacings * spacing_m);
  back.add(run.decoded.xyz, near.back, run, kNearSpacings * spacing_m);
  const double n = double(cloud.size());
  Cut c;
  c.tiles = run.tile_decode_seconds.size();
  c.tile_size_m = run.tile_size_m;
  c.bits = 8 * double(run.report.geometry_bytes) / n;
  c.rms_m = std::sqrt(std::max(forth.near + forth.inside, back.near + back.inside) / n);
  c.forth = forth.ratio();
  c.back = back.ratio();
  return c;
}

double longest_side(const PointCloud& cloud) {
  const Box b = cloud.bounds();
  return std::max({b.max[0] - b.min[0], b.max[1] - b.min[1], b.max[2] - b.min[2]});
}

/// Bits of `cut` at the RMS of `whole`: near the sampling floor bits fall with about the third power of the
/// RMS, and one coding is not exactly as good as another.
double bits_at_equal_rms(const Cut& cut, const Cut& whole) {
  return cut.bits * std::pow(cut.rms_m / whole.rms_m, 2.5);
}

}  // namespace

Status bench_seams(const BenchSettings& settings) {
  bench::Report report(settings, "seams", 1);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_ASSIGN(const std::vector<std::string> paths, bench::find_clouds(settings));
  const auto print = [&](const std::string& text) {
    settings.print(text);
    report.line(text.empty() ? text : "    " + text);
  };
  for (const std::string& path : paths) {
    const Result<BenchCloud> c = bench::load_cloud(path);
    if (!c.ok() || c->cloud.size() < kFewestPoints) continue;
    const double spacing = mean_spacing(c->cloud.xyz), side = longest_side(c->cloud);
    print("");
    print(fmt::format("{} ({} points)", c->name, c->cloud.size()));
    print(fmt::format("{:>8} {:>8} {:>6} {:>8} {:>8} {:>7} {:>10} {:>10}", "RMS mm", "tile m", "tiles",
                      "bits", "got mm", "bits x", "forth near", "back near"));
    const std::vector<double> sizes{2.01 * side, 0.0, side / 4, side / 8};
    for (const double r : settings.quick ? kQuickSpacings : kSpacings) {
      std::optional<Cut> whole;
      for (const double size : std::span(sizes).first(settings.quick ? 2 : sizes.size())) {
        const auto cut = measure(c->cloud, r * spacing, size, spacing, report.scratch());
        if (!cut.ok()) {
          report.note(c->name + ": " + cut.error().to_string());
          continue;
        }
        if (!whole) whole = *cut;
        const double share = bits_at_equal_rms(*cut, *whole) / whole->bits;
        print(fmt::format("{:>8} {:>8} {:>6} {:>8} {:>8} {:>7} {:>10} {:>10}{}", digits(r * spacing * 1e3),
                          digits(cut->tile_size_m), cut->tiles, digits(cut->bits), digits(cut->rms_m * 1e3),
                          digits(share), digits(cut->forth), digits(cut->back),
                          size == 0 ? "  usual size" : ""));
        report.json()["rows"].push_back({{"cloud", c->name},
                                         {"promise_m", r * spacing},
                                         {"usual", size == 0},
                                         {"tile_size_m", cut->tile_size_m},
                                         {"tiles", cut->tiles},
                                         {"bits_per_point", cut->bits},
                                         {"rms_m", cut->rms_m},
                                         {"bits_to_one_tile_at_equal_rms", share},
                                         {"rms_near_to_inside_forth", cut->forth},
                                         {"rms_near_to_inside_back", cut->back}});
      }
    }
  }
  return report.finish();
}

}  // namespace mapcodec
