// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/compress.hpp"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <memory>

#include "tools/verbs/bag_flags.hpp"
#include "tools/verbs/remote.hpp"
#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::vector<std::string> inputs;
  std::string output;
  std::optional<double> rms, max_error, target_ratio, target_bpp;
  bool lossless = false, paper = false, paper_raw = false, json = false, no_counts = false;
  std::string channels = "all", effort = "default", max_memory, progress = "auto", codec = "auto";
  CompressOptions options;
};

void add_promise(CLI::App& verb, Arguments& a) {
  auto* group = verb.add_option_group("promise", "What is kept; one of these (default --rms 0.01)");
  group->add_option("--rms", a.rms, "Symmetric RMS of the decoded cloud stays <= R [m]")
      ->check(CLI::PositiveNumber);
  group->add_option("--max-error", a.max_error, "Every point is kept and moves at most E along each axis [m]")
      ->check(CLI::PositiveNumber);
  group->add_flag("--lossless", a.lossless, "Every bit of every channel; the order of points may change");
  group->add_flag("--paper", a.paper, "The method of Morell et al. 2014: planes, triangles, counts");
  group->add_flag("--paper-raw", a.paper_raw, "The same, stored as the paper did, without entropy coding");
  group->add_option("--target-ratio", a.target_ratio, "Finds the RMS that gives this ratio to the raw size")
      ->check(CLI::PositiveNumber);
  group->add_option("--target-bpp", a.target_bpp, "Finds the RMS that gives this many bits per point")
      ->check(CLI::PositiveNumber);
  group->require_option(0, 1);
}

void add_paper_settings(CLI::App& verb, PaperSettings& p) {
  auto* group = verb.add_option_group("paper", "Parameters of --paper");
  group->add_option("--perc-process", p.perc_process, "Stop when this share of the points is left")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  group->add_option("--distance", p.distance_m, "RANSAC inlier threshold [m]")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  group->add_option("--min-points", p.min_points, "Smallest plane [points]")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  group->add_option("--outlier-k", p.outlier_k, "Neighbours a point needs within the radius")
      ->capture_default_str();
  group->add_option("--outlier-radius", p.outlier_radius_m, "Radius of the outlier filter [m]")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  group->add_option("--clusters", p.clusters, "K of K-means on colour")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  group->add_option("--alpha", p.alpha_m, "Radius of the alpha shape [m]")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  group->add_option("--rel-area", p.rel_area, "Least points per square metre of a kept triangle")
      ->capture_default_str();
  group
      ->add_option("--outside-density", p.outside_density,
                   "Not in the paper: triangles beyond the outline need this share of the plane's density")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
}

void add_coding(CLI::App& verb, Arguments& a) {
  CompressOptions& o = a.options;
  verb.add_option("--color-error", o.color_error, "Mean RGB distance allowed, 0..255; 0 = exact")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str()
      ->each([&o](const std::string&) { o.color_error_asked = true; });
  verb.add_option("--channels", a.channels, "all, none, or names separated by commas")->capture_default_str();
  verb.add_option("--tile-size", o.tile_size_m,
                  "Side of a tile [m]; default from the density, 100k points, 600k of surfaces")
      ->check(CLI::PositiveNumber);
  verb.add_option("--effort", a.effort, "Speed against size at the same promise: fast, default, high")
      ->check(CLI::IsMember({"fast", "default", "high"}))
      ->capture_default_str();
  verb.add_option("--codec", a.codec,
                  "With --rms or a target: surface, points, or for each tile the cheaper one")
      ->check(CLI::IsMember({"auto", "surface", "points"}))
      ->capture_default_str();
  verb.add_flag("--keep-order", o.keep_order, "With --lossless: also the order of the points");
  verb.add_flag("--no-counts", a.no_counts, "Points that share a voxel become one");
}

void add_unit(CLI::App& verb, CompressOptions& o) {
  verb.add_option("--unit", o.unit_m, "Metres per unit of the input, such as 0.01 for 3DTK's centimetres")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
}

void add_running(CLI::App& verb, Arguments& a) {
  verb.add_option("--threads", a.options.threads, "0: all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  verb.add_option("--max-memory", a.max_memory, "Such as 512M or 2G; default half of the machine's");
  verb.add_option("--temp-folder", a.options.temp_folder,
                  "For points that do not fit; default beside the output");
  verb.add_option("--progress", a.progress, "auto, bar, plain, json or none, on stderr")
      ->check(CLI::IsMember({"auto", "bar", "plain", "json", "none"}))
      ->capture_default_str();
  verb.add_flag("--json", a.json, "Summary as JSON on stdout");
  verb.add_flag("--force", a.options.overwrite, "Replace an existing output");
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  std::stringstream in(text);
  for (std::string part; std::getline(in, part, ',');) {
    if (!part.empty()) parts.push_back(part);
  }
  return parts;
}

Status complete(Arguments& a) {
  CompressOptions& o = a.options;
  if (a.max_error) {
    o.promise = PromiseKind::max_error;
    o.promise_m = *a.max_error;
  } else if (a.lossless) {
    o.promise = PromiseKind::lossless;
    o.promise_m = 0;
  } else if (a.paper || a.paper_raw) {
    o.promise = PromiseKind::paper;
    o.promise_m = 0;
    o.paper.raw = a.paper_raw;
  } else if (a.rms) {
    o.promise_m = *a.rms;
  }
  o.target_ratio = a.target_ratio;
  o.target_bits_per_point = a.target_bpp;
  o.keep_counts = !a.no_counts;
  o.effort = a.effort == "fast" ? Effort::fast : a.effort == "high" ? Effort::high : Effort::standard;
  o.codecs = a.codec == "surface"  ? CodecChoice::surface
             : a.codec == "points" ? CodecChoice::points
                                   : CodecChoice::cheapest;
  o.channels = split(a.channels);
  if (a.codec == "surface" && (a.max_error || a.lossless || a.paper || a.paper_raw || a.no_counts))
    return make_error(ErrorCode::kInvalidArgument, "--codec surface is for --rms with counts");
  if (o.keep_order && !a.lossless)
    return make_error(ErrorCode::kInvalidArgument, "--keep-order needs --lossless");
  if (!a.max_memory.empty()) {
    MAPCODEC_ASSIGN(o.max_memory_bytes, parse_size(a.max_memory));
  }
  o.stop = stop_flag();
  return {};
}

Json report_json(const MapFile& map, const CompressReport& r) {
  Json j = info_json(map);
  j["encode_seconds"] = r.seconds;
  j["points_per_second"] = r.seconds > 0 ? double(r.points) / r.seconds : 0;
  j["threads"] = r.threads;
  j["peak_memory_bytes"] = peak_memory_bytes();
  j["geometry_bytes"] = r.geometry_bytes;
  j["codings"] = r.codings;
  j["seconds"] = {{"survey", r.survey_seconds},
                  {"tiling", r.tiling_seconds},
                  {"search", r.search_seconds},
                  {"tiles", r.tiles_seconds},
                  {"commit", r.commit_seconds}};
  j["warnings"] = r.warnings;
  return j;
}

int run(Arguments& a) {
  if (const Status s = complete(a); !s.ok()) return fail("compress", s.error());
  a.options.progress = progress_printer(a.progress);
  const auto report = is_remote(a.output) ? compress_remote(a.inputs, a.output, a.options)
                                          : compress_files(a.inputs, a.output, a.options);
  a.options.progress = {};
  if (!report.ok()) {
    const bool output = report.error().code == ErrorCode::kCannotWrite;
    return fail(output ? a.output : a.inputs.front(), report.error());
  }
  for (const std::string& warning : report->warnings) spdlog::warn("note: {}", warning);
  const auto map = MapFile::open(a.output);
  if (!map.ok()) return fail(a.output, map.error());
  if (a.json) {
    fmt::print("{}\n", report_json(*map, *report).dump(2));
    return kDone;
  }
  print_info(*map);
  fmt::print("{:<12} {:.2f} s, {:.3g} M points/s on {} threads, peak memory {}\n", "time", report->seconds,
             double(report->points) / report->seconds / 1e6, report->threads,
             human_bytes(peak_memory_bytes()));
  return kDone;
}

}  // namespace

void add_compress(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("compress", "Points, scans or maps in; an archive out");
  verb->add_option("INPUT", a->inputs, "Files of points; together one map")->required();
  verb->add_option("-o,--output", a->output, "The archive, MAP.mapc")->required();
  add_promise(*verb, *a);
  add_coding(*verb, *a);
  add_unit(*verb, a->options);
  add_bag_flags(*verb, a->options.bag);
  add_paper_settings(*verb, a->options.paper);
  add_running(*verb, *a);
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
