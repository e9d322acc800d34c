// SPDX-License-Identifier: GPL-3.0-or-later
// The experiments of the 2014 paper, redone: its figures 4 and 5 (share of processed points against ratio,
// error and time) and 7, 8 (number of colour clusters), beside the figures that it printed.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "parallel/runner.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/paper_runs.hpp"
#include "tools/bench/report.hpp"
#include "tools/peers/peers.hpp"

namespace mapcodec {
namespace {

using bench::BenchCloud;
using bench::digits;
using bench::Json;
using bench::PaperRow;
using bench::ReductionRow;
using bench::Subject;

constexpr std::size_t kFewestPoints = 50000, kMostFrames = 4;

/// What the paper printed for its Kinect frame (its section on colour).
struct PrintedFigure {
  std::uint32_t clusters;
  double ratio, color_error, rms_m;
};
constexpr PrintedFigure kPrinted[] = {{1, 0.267, 74.9, 0.01123},
                                      {3, 0.290, 57.7, 0.00991},
                                      {5, 0.316, 52.8, 0.00940},
                                      {10, 0.365, 50.2, 0.00849},
                                      {20, 0.389, 50.5, 0.00856}};

std::vector<double> shares(const Subject& s) {
  if (s.quick) return {0.05, 0.5};
  if (s.cloud.cloud.size() > 500000) return {0.05, 0.35, 0.65, 0.95};
  std::vector<double> r;
  for (int i = 1; i <= 19; i += 2) r.push_back(0.05 * i);
  return r;
}

/// Two figures in one cell: raw and coded.
std::string both(double raw, double coded) {
  return fmt::format("{} / {}", digits(raw), digits(coded));
}

/// Figure 4 and 5: the share that is left unprocessed against ratio, error and time, with both reductions at
/// equal ratio.
class ShareExperiment {
 public:
  ShareExperiment(const Subject& subject, bench::Report& report) : subject_(subject), report_(report) {}

  void run() {
    report_.table({"percProcess", "ratio (raw, as the paper)", "ratio (entropy coded)", "RMS mm", "max mm",
                   "density error", "encode s", "reconstruction ms", "voxel grid RMS mm at equal ratio",
                   "octree centres RMS mm", "their density errors"});
    for (const double share : shares(subject_)) measure(share);
  }
  [[nodiscard]] const Json& json() const { return json_; }
  [[nodiscard]] std::vector<bench::Plot> plots() const {
    return {{subject_.cloud.name + ": error against ratio",
             "compressed size / original size",
             "RMS error [mm]",
             true,
             true,
             {planes_, coded_planes_, reductions_[0], reductions_[1]}},
            {subject_.cloud.name + ": ratio against percProcess",
             "percProcess",
             "compressed size / original size",
             false,
             false,
             {raw_ratio_, coded_ratio_}}};
  }

 private:
  void measure(double share) {
    const auto raw = run_paper(subject_, share, 1, true), coded = run_paper(subject_, share, 1, false);
    if (!raw.ok() || !coded.ok()) {
      return report_.note(subject_.cloud.name + ": " + (raw.ok() ? coded : raw).error().to_string());
    }
    json_.push_back(row_json(*raw));
    json_.push_back(row_json(*coded));
    planes_.points.emplace_back(raw->ratio, raw->rms_m * 1e3);
    coded_planes_.points.emplace_back(coded->ratio, coded->rms_m * 1e3);
    raw_ratio_.points.emplace_back(share, raw->ratio);
    coded_ratio_.points.emplace_back(share, coded->ratio);
    const auto [grid, centres] = measure_reductions(raw->ratio);
    report_.row({digits(share), digits(raw->ratio), digits(coded->ratio),
                 both(raw->rms_m * 1e3, coded->rms_m * 1e3), both(raw->max_m * 1e3, coded->max_m * 1e3),
                 both(raw->density_error, coded->density_error), both(raw->encode_s, coded->encode_s),
                 both(raw->decode_s * 1e3, coded->decode_s * 1e3), digits(grid.rms_m * 1e3),
                 digits(centres.rms_m * 1e3), both(grid.density_error, centres.density_error)});
  }

  std::pair<ReductionRow, ReductionRow> measure_reductions(double ratio) {
    ReductionRow rows[2];
    for (ReductionRow& r : rows) r.rms_m = r.density_error = std::nan("");
    for (const peers::Peer& p : peers::available_peers()) {
      const int place = p.name == "pcl-voxelgrid" ? 0 : p.name == "pcl-octree-centres" ? 1 : -1;
      if (place < 0) continue;
      const auto row = reduce_to_ratio(subject_, p, ratio);
      if (!row.ok()) continue;
      rows[place] = *row;
      json_.push_back(row_json(*row));
      reductions_[place].points.emplace_back(row->ratio, row->rms_m * 1e3);
    }
    return {rows[0], rows[1]};
  }

  const Subject& subject_;
  bench::Report& report_;
  Json json_ = Json::array();
  bench::Series planes_{"planes, raw (2014 method)", {}, true},
      coded_planes_{"planes, entropy coded", {}, true}, raw_ratio_{"raw, as the paper", {}, true},
      coded_ratio_{"entropy coded", {}, true};
  bench::Series reductions_[2] = {{"voxel grid (centroids)", {}, true}, {"octree (centres)", {}, true}};
};

/// Figures 7 and 8: clusters of K-means against ratio, colour error and RMS.
class ClusterExperiment {
 public:
  ClusterExperiment(const Subject& subject, bench::Report& report) : subject_(subject), report_(report) {}

  void run() {
    report_.table({"K", "ratio (raw)", "ratio (entropy coded)", "colour error", "RMS mm", "density error",
                   "paper's ratio", "paper's colour error", "paper's RMS mm"});
    for (const PrintedFigure& printed : kPrinted) {
      if (!subject_.quick || printed.clusters == 1 || printed.clusters == 10) measure(printed);
    }
  }
  [[nodiscard]] const Json& json() const { return json_; }
  [[nodiscard]] std::vector<bench::Plot> plots() const {
    return {{subject_.cloud.name + ": colour error against K",
             "clusters K",
             "mean RGB distance",
             true,
             false,
             {color_, color_coded_, color_printed_}},
            {subject_.cloud.name + ": ratio against K",
             "clusters K",
             "compressed size / original size",
             true,
             false,
             {ratio_, ratio_coded_, ratio_printed_}}};
  }

 private:
  void measure(const PrintedFigure& printed) {
    constexpr double kShare = 0.2;
    const auto raw = run_paper(subject_, kShare, printed.clusters, true);
    const auto coded = run_paper(subject_, kShare, printed.clusters, false);
    if (!raw.ok() || !coded.ok()) {
      return report_.note(subject_.cloud.name + ": " + (raw.ok() ? coded : raw).error().to_string());
    }
    json_.push_back(row_json(*raw));
    json_.back()["printed"] = {
        {"ratio", printed.ratio}, {"color_error", printed.color_error}, {"rms_m", printed.rms_m}};
    json_.push_back(row_json(*coded));
    const double k = printed.clusters;
    color_.points.emplace_back(k, raw->color_error);
    color_coded_.points.emplace_back(k, coded->color_error);
    ratio_.points.emplace_back(k, raw->ratio);
    ratio_coded_.points.emplace_back(k, coded->ratio);
    color_printed_.points.emplace_back(k, printed.color_error);
    ratio_printed_.points.emplace_back(k, printed.ratio);
    report_.row({std::to_string(printed.clusters), digits(raw->ratio), digits(coded->ratio),
                 both(raw->color_error, coded->color_error), both(raw->rms_m * 1e3, coded->rms_m * 1e3),
                 both(raw->density_error, coded->density_error), digits(printed.ratio),
                 digits(printed.color_error), digits(printed.rms_m * 1e3)});
  }

  const Subject& subject_;
  bench::Report& report_;
  Json json_ = Json::array();
  bench::Series color_{"here (raw)", {}, true}, color_coded_{"here (entropy coded)", {}, true},
      ratio_{"here (raw)", {}, true}, ratio_coded_{"here (entropy coded)", {}, true};
  bench::Series color_printed_{"the paper's frame", {}, true}, ratio_printed_{"the paper's frame", {}, true};
};

Status measure_cloud(const Subject& subject, bench::Report& report) {
  const BenchCloud& c = subject.cloud;
  report.line("");
  report.line(fmt::format("## {} ({} points)", c.name, c.cloud.size()));
  Json entry{{"cloud", c.name}, {"points", c.cloud.size()}};
  ShareExperiment share(subject, report);
  share.run();
  entry["perc_process"] = share.json();
  MAPCODEC_TRY(report.plot(share.plots(), c.name));
  if (c.cloud.find("rgb") != nullptr) {
    ClusterExperiment clusters(subject, report);
    clusters.run();
    entry["clusters"] = clusters.json();
    MAPCODEC_TRY(report.plot(clusters.plots(), c.name + "_clusters"));
  }
  report.json()["clouds"].push_back(std::move(entry));
  return {};
}

/// A few depth camera frames, coloured ones first, and one scan that is not a frame: the first with colour,
/// else the first. With settings.files: all of them.
class Selection {
 public:
  explicit Selection(const BenchSettings& settings) : all_(!settings.files.empty()), quick_(settings.quick) {}

  void offer(BenchCloud&& c) {
    if (c.cloud.size() < kFewestPoints) return;
    if (all_) return chosen_.push_back(std::move(c));
    if (bench::is_camera_frame(c.cloud)) return offer_frame(std::move(c));
    if (!quick_) offer_scan(std::move(c));
  }
  std::vector<BenchCloud> take() {
    for (BenchCloud& c : scan_) chosen_.push_back(std::move(c));
    return std::move(chosen_);
  }

 private:
  static bool has_color(const BenchCloud& c) { return c.cloud.find("rgb") != nullptr; }
  void offer_frame(BenchCloud&& c) {
    if (chosen_.size() < (quick_ ? 1 : kMostFrames)) return chosen_.push_back(std::move(c));
    for (BenchCloud& old : chosen_) {
      if (has_color(c) && !has_color(old)) return void(old = std::move(c));
    }
  }
  void offer_scan(BenchCloud&& c) {
    const bool better =
        scan_.empty() || (has_color(c) && !has_color(scan_.front())) ||
        (has_color(c) == has_color(scan_.front()) && c.cloud.size() < scan_.front().cloud.size());
    if (better) scan_ = {std::move(c)};
  }

  bool all_, quick_;
  std::vector<BenchCloud> chosen_, scan_;
};

}  // namespace

Status bench_paper(const BenchSettings& settings) {
  Arena arena(settings.threads);
  TbbRunner runner(arena);
  bench::Report report(settings, "paper", 1);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_ASSIGN(const std::vector<std::string> paths, bench::find_clouds(settings));
  Selection selection(settings);
  for (const std::string& path : paths) {
    auto c = bench::load_cloud(path);
    if (c.ok()) selection.offer(std::move(*c));
  }
  const std::vector<BenchCloud> clouds = selection.take();
  if (clouds.empty())
    return make_error(ErrorCode::kEmpty, settings.data + ": no depth camera frame and no scan");
  report.line(
      "Ratio: archive bytes to 12 bytes a point (16 with colour); lower is better. Two figures in a cell: "
      "stored raw as the paper did / entropy coded. Parameters as the "
      "paper's: "
      "distance 0.05, alpha 0.15; contours are reduced by the codec's default.");
  for (const BenchCloud& c : clouds) {
    settings.say(c.name);
    MAPCODEC_TRY(measure_cloud({c, runner, report.scratch(), settings.quick}, report));
  }
  return report.finish();
}

}  // namespace mapcodec
