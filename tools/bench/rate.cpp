// SPDX-License-Identifier: GPL-3.0-or-later
// Bits against error and speed: every mode of ours and every peer, on the same points in the same run.
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <map>

#include "mapcodec/quality/evaluation.hpp"
#include "parallel/runner.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/codec_run.hpp"
#include "tools/bench/report.hpp"
#include "tools/peers/peers.hpp"

namespace mapcodec {
namespace {

using bench::BenchCloud;
using bench::digits;
using bench::Json;

constexpr std::size_t kFewestPoints = 50000;
constexpr std::size_t kQuickClouds = 3, kQuickMostPoints = 400000;
const std::vector<double> kBoundsM{0.001, 0.002, 0.005, 0.010, 0.020, 0.050};
const std::vector<double> kQuickBoundsM{0.002, 0.010};

/// One codec on one cloud at one setting. Bits and speeds are per input point.
struct Row {
  std::string codec;
  double bound_m = 0;  ///< 0: the codec has none
  double bits = 0, rms_m = 0, max_axis_m = 0, density = 0, count_ratio = 0;
  double encode_mpps = 0, decode_mpps = 0;
};

/// What is left of a codec's run before its points are compared.
struct Outcome {
  std::string codec;
  double bound_m = 0;
  std::uint64_t bytes = 0;
  double encode_seconds = 0, decode_seconds = 0;
  PointCloud decoded;
};

double million_per_second(std::size_t points, double seconds) {
  return seconds > 0 ? static_cast<double>(points) / seconds / 1e6 : std::nan("");
}

/// Compares with the original; codecs that give the same points as the one before are compared once.
class Judge {
 public:
  Judge(const PointCloud& original, Runner& runner) : original_(original), runner_(runner) {}

  Result<Row> judge(Outcome o) {
    if (!last_ || o.decoded.xyz != last_points_) {
      EvaluationSettings settings;
      settings.with_normals = false;
      MAPCODEC_ASSIGN(last_, evaluate(original_, o.decoded, runner_, settings));
      last_points_ = std::move(o.decoded.xyz);
    }
    const std::size_t n = original_.size();
    return Row{o.codec,
               o.bound_m,
               8 * static_cast<double>(o.bytes) / static_cast<double>(n),
               last_->rms_m,
               last_->max_axis_error_m,
               last_->density_error,
               last_->count_ratio,
               million_per_second(n, o.encode_seconds),
               million_per_second(n, o.decode_seconds)};
  }

 private:
  const PointCloud& original_;
  Runner& runner_;
  std::optional<Evaluation> last_;
  std::vector<Vec3> last_points_;
};

CompressOptions geometry_alone() {
  CompressOptions o;
  o.channels = {"none"};
  o.threads = 1;
  return o;
}

struct Mode {
  std::string name;
  CompressOptions options;
};

std::vector<Mode> bounded_modes(double bound_m) {
  std::vector<Mode> modes;
  for (const auto& [name, effort] :
       {std::pair{"points-fast", Effort::fast}, std::pair{"points-standard", Effort::standard},
        std::pair{"points-high", Effort::high}}) {
    CompressOptions o = geometry_alone();
    o.promise = PromiseKind::max_error;
    o.promise_m = bound_m;
    o.effort = effort;
    modes.push_back({name, o});
  }
  for (const auto& [name, codecs] :
       {std::pair{"surface", CodecChoice::surface}, std::pair{"auto", CodecChoice::cheapest}}) {
    CompressOptions o = geometry_alone();
    o.promise = PromiseKind::rms;
    o.promise_m = bound_m;
    o.codecs = codecs;
    modes.push_back({name, o});
  }
  return modes;
}

std::vector<Mode> modes_without_bound() {
  CompressOptions lossless = geometry_alone(), paper = geometry_alone();
  lossless.promise = PromiseKind::lossless;
  paper.promise = PromiseKind::paper;
  return {{"lossless", lossless}, {"paper", paper}};
}

/// One cloud's measurements.
class CloudBench {
 public:
  CloudBench(const PointCloud& cloud, Runner& runner, bench::Report& report, std::string name)
      : cloud_(cloud), judge_(cloud_, runner), report_(report), name_(std::move(name)) {}

  void measure_bound(double bound_m) {
    for (const Mode& m : bounded_modes(bound_m)) add_ours(m, bound_m);
    for (const peers::Peer& p : peers::available_peers()) {
      if (!p.lossless) add_peer(p, bound_m);
    }
  }
  void measure_once() {
    for (const Mode& m : modes_without_bound()) add_ours(m, 0);
    for (const peers::Peer& p : peers::available_peers()) {
      if (p.lossless) add_peer(p, 0);
    }
  }
  [[nodiscard]] const std::vector<Row>& rows() const { return rows_; }

 private:
  void add_ours(const Mode& mode, double bound_m) {
    auto run = bench::run_codec(cloud_, mode.options, report_.scratch());
    if (!run.ok()) return skip(mode.name, bound_m, run.error());
    add({mode.name, bound_m, run->report.geometry_bytes, run->encode_seconds, run->decode_seconds,
         std::move(run->decoded)});
  }
  void add_peer(const peers::Peer& peer, double bound_m) {
    auto run = peer.run(cloud_.xyz, 2 * bound_m);
    if (!run.ok()) return skip(peer.name, bound_m, run.error());
    PointCloud decoded;
    decoded.xyz = std::move(run->decoded);
    add({peer.name, bound_m, run->bytes, run->encode_seconds, run->decode_seconds, std::move(decoded)});
  }
  void add(Outcome o) {
    const std::string codec = o.codec;
    const double bound_m = o.bound_m;
    auto row = judge_.judge(std::move(o));
    if (!row.ok()) return skip(codec, bound_m, row.error());
    rows_.push_back(std::move(*row));
  }
  void skip(const std::string& codec, double bound_m, const Error& e) {
    report_.note(fmt::format("{}, {} at {} mm: {}", name_, codec, digits(bound_m * 1e3), e.to_string()));
  }

  const PointCloud& cloud_;
  Judge judge_;
  bench::Report& report_;
  std::string name_;
  std::vector<Row> rows_;
};

Json number(double v) {
  return std::isfinite(v) ? Json(v) : Json(nullptr);
}

Json row_json(const Row& r) {
  return {{"codec", r.codec},
          {"bound_m", r.bound_m},
          {"bits_per_point", r.bits},
          {"rms_m", number(r.rms_m)},
          {"max_axis_error_m", number(r.max_axis_m)},
          {"density_error", number(r.density)},
          {"count_ratio", r.count_ratio},
          {"encode_mpoints_per_s", number(r.encode_mpps)},
          {"decode_mpoints_per_s", number(r.decode_mpps)}};
}

const Row* find_row(const std::vector<Row>& rows, const std::string& codec, double bound_m) {
  for (const Row& r : rows) {
    if (r.codec == codec && r.bound_m == bound_m) return &r;
  }
  return nullptr;
}

/// Our speed as a multiple of Draco's at the same bound, "-" where there is none.
std::string against_draco(const std::vector<Row>& rows, const Row& r, double Row::*speed) {
  const Row* draco = find_row(rows, "draco", r.bound_m);
  const bool comparable = draco != nullptr && std::isfinite(r.*speed);
  return !comparable ? "-" : fmt::format("x{}", digits(r.*speed / (draco->*speed), 2));
}

void write_table(bench::Report& report, const std::vector<Row>& rows) {
  report.table({"bound mm", "codec", "bits/point", "RMS mm", "density error", "points kept", "encode Mpt/s",
                "decode Mpt/s", "encode : Draco", "decode : Draco"});
  for (const Row& r : rows) {
    report.row({r.bound_m > 0 ? digits(r.bound_m * 1e3) : "-", r.codec, digits(r.bits), digits(r.rms_m * 1e3),
                digits(r.density), digits(r.count_ratio), digits(r.encode_mpps), digits(r.decode_mpps),
                against_draco(rows, r, &Row::encode_mpps), against_draco(rows, r, &Row::decode_mpps)});
  }
}

bench::Plot rate_plot(const std::string& name, const std::vector<Row>& rows) {
  bench::Plot plot{name, "RMS error [mm]", "bits per point (geometry)", true, true, {}};
  std::map<std::string, std::size_t> place;
  for (const Row& r : rows) {
    if (r.bound_m == 0 && r.codec != "paper") continue;
    const auto [it, fresh] = place.emplace(r.codec, plot.series.size());
    if (fresh) plot.series.push_back({r.codec, {}, true});
    plot.series[it->second].points.emplace_back(r.rms_m * 1e3, r.bits);
  }
  return plot;
}

Status measure_cloud(const BenchCloud& c, const BenchSettings& settings, Runner& runner,
                     bench::Report& report) {
  CloudBench b(c.cloud, runner, report, c.name);
  for (const double bound : settings.quick ? kQuickBoundsM : kBoundsM) {
    settings.say(fmt::format("{}: bound {} mm", c.name, digits(bound * 1e3)));
    b.measure_bound(bound);
  }
  settings.say(c.name + ": lossless, paper");
  b.measure_once();
  Json entry{{"cloud", c.name}, {"points", c.cloud.size()}, {"rows", Json::array()}};
  for (const Row& r : b.rows()) entry["rows"].push_back(row_json(r));
  report.json()["clouds"].push_back(std::move(entry));
  report.line("");
  report.line(fmt::format("## {} ({} points)", c.name, c.cloud.size()));
  write_table(report, b.rows());
  return report.plot({rate_plot(c.name, b.rows())}, c.name);
}

/// Clouds large enough to mean something; in a quick run only few and small ones.
bool is_fit(const BenchCloud& c, const BenchSettings& settings, std::size_t measured) {
  if (c.cloud.size() < kFewestPoints) return false;
  if (!settings.quick || !settings.files.empty()) return true;
  return measured < kQuickClouds && c.cloud.size() <= kQuickMostPoints;
}

}  // namespace

Status bench_rate(const BenchSettings& settings) {
  Arena arena(settings.threads);
  TbbRunner runner(arena);
  bench::Report report(settings, "rate", 1);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_ASSIGN(const std::vector<std::string> paths, bench::find_clouds(settings));
  report.line(
      "Geometry alone, bits per input point; a bound is the largest error along an axis, cells are twice as "
      "wide; of surface and auto it is the RMS.");
  report.line(
      "Speeds are of one core, by its processor time: ours with quantising, measuring and reading the "
      "archive, peers' in memory.");
  for (const std::string& name : peers::absent_peers()) report.note("absent in this build: " + name);
  std::size_t measured = 0;
  for (const std::string& path : paths) {
    const Result<BenchCloud> c = bench::load_cloud(path);
    if (!c.ok() || !is_fit(*c, settings, measured)) continue;
    MAPCODEC_TRY(measure_cloud(*c, settings, runner, report));
    ++measured;
  }
  if (measured == 0)
    return make_error(ErrorCode::kEmpty, settings.data + ": no cloud of 50,000 points or more");
  return report.finish();
}

}  // namespace mapcodec
