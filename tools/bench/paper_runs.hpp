// SPDX-License-Identifier: GPL-3.0-or-later
// Single runs of the 2014 method and of what its paper compares it with.
#pragma once

#include <string>

#include "mapcodec/quality/evaluation.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/machine.hpp"
#include "tools/peers/peers.hpp"

namespace mapcodec::bench {

/// One run of the method on one cloud.
struct PaperRow {
  double perc_process = 0;
  std::uint32_t clusters = 1;
  bool raw = true;
  double ratio = 0, rms_m = 0, max_m = 0, color_error = 0, density_error = 0;
  double encode_s = 0, decode_s = 0;
};

/// A reduction of PCL's at the same ratio.
struct ReductionRow {
  std::string name;
  double ratio = 0, rms_m = 0, density_error = 0, cell_m = 0, seconds = 0;
};

/// One cloud with the means to compare with it.
struct Subject {
  const BenchCloud& cloud;
  Runner& runner;
  std::string scratch;
  bool quick = false;

  /// Without normals.
  [[nodiscard]] Result<Evaluation> compare(const PointCloud& decoded) const;
};

/// Compresses and decodes with the paper's parameters for a Kinect frame. Errors: those of the codec.
/// @param raw  stored as the paper did, else entropy coded.
[[nodiscard]] Result<PaperRow> run_paper(const Subject& subject, double perc_process, std::uint32_t clusters,
                                         bool raw);

/// The peer with the cells that give `ratio` of 12 bytes a point, by bisection (the size falls as cells
/// grow).
[[nodiscard]] Result<ReductionRow> reduce_to_ratio(const Subject& subject, const peers::Peer& peer,
                                                   double ratio);

[[nodiscard]] Json row_json(const PaperRow& row);
[[nodiscard]] Json row_json(const ReductionRow& row);

}  // namespace mapcodec::bench
