// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/paper_runs.hpp"

#include <cmath>

#include "tools/bench/codec_run.hpp"

namespace mapcodec::bench {
namespace {

/// The paper's parameters for a Kinect frame: 0.05 0.15 0.2 0.05 1.
CompressOptions paper_options(double perc_process, std::uint32_t clusters, bool raw) {
  CompressOptions o;
  o.promise = PromiseKind::paper;
  o.threads = 1;
  o.paper.perc_process = perc_process;
  o.paper.distance_m = 0.05;
  o.paper.alpha_m = 0.15;
  o.paper.clusters = clusters;
  o.paper.raw = raw;
  return o;
}

Json number(double v) {
  return std::isfinite(v) ? Json(v) : Json(nullptr);
}

}  // namespace

Result<Evaluation> Subject::compare(const PointCloud& decoded) const {
  EvaluationSettings s;
  s.with_normals = false;
  return evaluate(cloud.cloud, decoded, runner, s);
}

Result<PaperRow> run_paper(const Subject& s, double perc_process, std::uint32_t clusters, bool raw) {
  MAPCODEC_ASSIGN(const CodecRun run,
                  run_codec(s.cloud.cloud, paper_options(perc_process, clusters, raw), s.scratch));
  MAPCODEC_ASSIGN(const Evaluation e, s.compare(run.decoded));
  return PaperRow{perc_process,
                  clusters,
                  raw,
                  double(run.archive_bytes) / double(run.raw_bytes),
                  e.rms_m,
                  e.max_m,
                  e.color_error,
                  e.density_error,
                  run.encode_seconds,
                  run.decode_seconds};
}

Result<ReductionRow> reduce_to_ratio(const Subject& s, const peers::Peer& peer, double ratio) {
  double small = 1e-4, large = 1;
  peers::PeerRun best;
  for (int i = 0; i < 12; ++i) {
    const double cell = std::sqrt(small * large);
    MAPCODEC_ASSIGN(best, peer.run(s.cloud.cloud.xyz, cell));
    const double got = double(best.bytes) / (12.0 * double(s.cloud.cloud.size()));
    (got > ratio ? small : large) = cell;
  }
  PointCloud decoded;
  decoded.xyz = std::move(best.decoded);
  MAPCODEC_ASSIGN(const Evaluation e, s.compare(decoded));
  return ReductionRow{peer.name,
                      double(best.bytes) / (12.0 * double(s.cloud.cloud.size())),
                      e.rms_m,
                      e.density_error,
                      std::sqrt(small * large),
                      best.encode_seconds};
}

Json row_json(const PaperRow& r) {
  return {{"perc_process", r.perc_process},
          {"clusters", r.clusters},
          {"raw", r.raw},
          {"ratio", r.ratio},
          {"rms_m", number(r.rms_m)},
          {"max_m", number(r.max_m)},
          {"color_error", number(r.color_error)},
          {"density_error", number(r.density_error)},
          {"encode_seconds", r.encode_s},
          {"reconstruction_seconds", r.decode_s}};
}

Json row_json(const ReductionRow& r) {
  return {{"method", r.name},         {"ratio", r.ratio},
          {"rms_m", number(r.rms_m)}, {"density_error", number(r.density_error)},
          {"cell_m", r.cell_m},       {"seconds", r.seconds}};
}

}  // namespace mapcodec::bench
