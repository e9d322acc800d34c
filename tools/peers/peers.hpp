// SPDX-License-Identifier: GPL-3.0-or-later
// Codecs of others behind one door, for comparisons on the same points in the same run.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec::peers {

struct PeerRun {
  std::uint64_t bytes = 0;
  double encode_seconds = 0, decode_seconds = 0;  ///< processor time of the peer's own work in memory
  std::vector<Vec3> decoded;                      ///< [m]
};

struct Peer {
  std::string name;
  bool lossless = false;      ///< ignores the step
  bool keeps_points = false;  ///< as many points out as in
  /// Encodes and decodes finite points, not empty, with cells of `step_m`. What the peer throws is caught.
  /// Errors: InvalidArgument (the cloud is too large for the peer at this step), Unsupported (the peer
  /// failed).
  std::function<Result<PeerRun>(const std::vector<Vec3>& points, double step_m)> run;
};

/// Those that this build has, in the order of the reports.
[[nodiscard]] std::vector<Peer> available_peers();
/// Names of those that it lacks.
[[nodiscard]] std::vector<std::string> absent_peers();

}  // namespace mapcodec::peers
