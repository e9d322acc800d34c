// SPDX-License-Identifier: GPL-3.0-or-later
// The paper's table: bytes, ratio, RMS and colour error against K, for the raw and the entropy-coded form.
//   paper_bench cloud [name=value ...]
// Names: perc, distance, alpha, radius, rel_area, reduction, step, min_points, bound (of the colour).
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include "mapcodec/codec/paper_decoder.hpp"
#include "mapcodec/codec/paper_encoder.hpp"
#include "mapcodec/quality/evaluation.hpp"
#include "slam_adapter/formats/formats.hpp"

namespace {

using namespace mapcodec;
using Options = std::map<std::string, double>;

Result<PointCloud> read(const char* path) {
  MAPCODEC_ASSIGN(const auto source, open_source(path));
  PointCloud all = source->layout(), block;
  while (true) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) break;
    all.append(block);
  }
  std::erase_if(all.channels, [](const Channel& c) { return c.info.name != "rgb"; });
  return all;
}

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 2; i < argc; ++i) {
    const std::string text = argv[i];
    const std::size_t equals = text.find('=');
    if (equals != std::string::npos) options[text.substr(0, equals)] = std::atof(text.c_str() + equals + 1);
  }
  return options;
}

PaperSettings settings_from(const Options& options) {
  PaperSettings s;
  const std::pair<const char*, double*> lengths[] = {
      {"perc", &s.perc_process},       {"distance", &s.distance_m}, {"alpha", &s.alpha_m},
      {"radius", &s.outlier_radius_m}, {"rel_area", &s.rel_area},   {"reduction", &s.reduction_m},
      {"step", &s.leftover_step_m}};
  for (const auto& [name, value] : lengths) {
    if (options.count(name) != 0) *value = options.at(name);
  }
  if (options.count("min_points") != 0) s.min_points = static_cast<std::uint32_t>(options.at("min_points"));
  return s;
}

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Status run(const PointCloud& cloud, const MapSchema& schema, const PaperSettings& settings) {
  const double start = seconds();
  MAPCODEC_ASSIGN(const PaperEncoding e, encode_paper(cloud, schema, settings));
  const double encoded = seconds();
  MAPCODEC_ASSIGN(const PointCloud decoded, decode_paper(e.bytes, e.points, schema));
  const double done = seconds();
  SerialRunner runner;
  MAPCODEC_ASSIGN(const Evaluation q, evaluate(cloud, decoded, runner, {.with_normals = false}));
  const double n = static_cast<double>(cloud.size());
  std::printf(
      "%-5s K %2u  bytes %8zu  ratio %.4f  planes %3lu  triangles %5lu  left %.3f  plane bytes %6lu  RMS mm "
      "%.2f "
      "(%.2f, %.2f)  colour %.1f  density %.2f  encode s/M %.2f  decode M/s %.1f\n",
      settings.raw ? "raw" : "coded", settings.clusters, e.bytes.size(),
      static_cast<double>(e.bytes.size()) / (16 * n), static_cast<unsigned long>(e.stats.planes),
      static_cast<unsigned long>(e.stats.triangles), static_cast<double>(e.stats.leftover_points) / n,
      static_cast<unsigned long>(e.stats.plane_bytes), 1e3 * q.rms_m, 1e3 * q.rms_ab_m, 1e3 * q.rms_ba_m,
      q.color_error, q.density_error, (encoded - start) / n * 1e6, n / (done - encoded) * 1e-6);
  return {};
}

Status run_table(const char* path, const Options& options) {
  MAPCODEC_ASSIGN(const PointCloud cloud, read(path));
  MapSchema schema;
  schema.promise = PromiseKind::paper;
  schema.coordinates = cloud.coordinates;
  const double bound = options.count("bound") != 0 ? options.at("bound") : 6;
  for (const Channel& c : cloud.channels)
    schema.channels.push_back({c.info, ChannelKept::bounded, bound, {}});
  PaperSettings settings = settings_from(options);
  for (const std::uint32_t clusters : {1u, 3u, 5u, 10u, 20u}) {
    settings.clusters = clusters;
    for (const bool raw : {true, false}) {
      settings.raw = raw;
      MAPCODEC_TRY(run(cloud, schema, settings));
    }
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: paper_bench cloud [name=value ...]\n");
    return 2;
  }
  const Status done = run_table(argv[1], parse(argc, argv));
  if (!done.ok()) std::fprintf(stderr, "%s\n", done.error().to_string().c_str());
  return done.ok() ? 0 : 1;
}
