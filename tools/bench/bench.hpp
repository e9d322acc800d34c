// SPDX-License-Identifier: GPL-3.0-or-later
// The measurements of `mapcodec bench`: each writes JSON, a markdown table and plots into the report folder.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

struct BenchSettings {
  std::string data;                ///< folder that is searched for clouds, with its subfolders
  std::string report;              ///< folder for the results; made if need be
  int threads = 0;                 ///< for evaluating and scaling; 0: all. Codecs are timed on one core
  std::vector<std::string> files;  ///< if not empty: only clouds whose path contains one of these
  bool quick = false;              ///< few clouds and bounds: minutes instead of an hour
  std::function<void(const std::string&)> say = [](const std::string&) {};  ///< told what is being measured
  double minutes = 5;        ///< bench_service: of the mixed load
  bool goals_alone = false;  ///< bench_surface: only the clouds with goals, at these
  std::function<void(const std::string&)> print = [](const std::string&) {
  };  ///< lines of tables, as they come
};

/// Size against error and speed, ours beside the peers (rate.json, rate.md, rate_*.png).
/// Errors of all three: NotFound (no data folder), Empty (no cloud fits), CannotWrite, those of the codec.
/// Threads: one bench at a time.
[[nodiscard]] Status bench_rate(const BenchSettings& settings);
/// Speed on one to all cores, and what the measured tiles would take on more (scaling.json, scaling.md,
/// scaling.png).
[[nodiscard]] Status bench_scaling(const BenchSettings& settings);
/// Surfaces, points and the choice between them at promises around each cloud's spacing, and the surface
/// codec's goals (surface.json, surface.md).
[[nodiscard]] Status bench_surface(const BenchSettings& settings);
/// What cutting into tiles costs: bits and RMS of the map in one tile, in tiles of the usual size and in
/// smaller ones, near the borders and inside (seams.json, seams.md).
[[nodiscard]] Status bench_seams(const BenchSettings& settings);
/// The experiments of Morell et al. 2014 on our data (paper.json, paper.md, paper_*.png).
[[nodiscard]] Status bench_paper(const BenchSettings& settings);

/// Tiles fetched and decoded, a drive with a LocalMap, and localisation in compressed maps against the raw
/// one (local.json, local.md). `files` chooses: "tiles", "drive", and sequences by parts of their names.
[[nodiscard]] Status bench_local(const BenchSettings& settings);

/// Bags, LAZ, COPC, E57 and Autoware folders: read, compressed without loss, written, compared (formats.json,
/// formats.md). A file that is refused is a row with its message.
[[nodiscard]] Status bench_formats(const BenchSettings& settings);

/// Maps built scan after scan beside maps made at once, tiles that grow until they are split, and points
/// taken in by a large map while it is read (update.json, update.md). `files` chooses: "growth", "ingest",
/// and sequences by parts of their names. `quick`: a map of 5 instead of 50 million points.
[[nodiscard]] Status bench_update(const BenchSettings& settings);

/// Octrees (.bt, .ot) and OctoMap's scan.dat: size beside zstd, time beside OctoMap, leaf by leaf the same,
/// and a box out of a large map (octomap.json, octomap.md). Errors: also PromiseBroken (a leaf differs);
/// Unsupported (no OctoMap).
[[nodiscard]] Status bench_octomap(const BenchSettings& settings);
/// A mapcodecd under load: tiles beside a bare gRPC stream, copies that follow, writers and readers, memory
/// over minutes (service.json, service.md, service_soak.png). There where the service is built.
[[nodiscard]] Status bench_service(const BenchSettings& settings);
/// Rawlogs and simplemaps beside MRPT's own reading of them (mrpt.json, mrpt.md). Needs mrpt_peer beside this
/// program.
[[nodiscard]] Status bench_mrpt(const BenchSettings& settings);

}  // namespace mapcodec
