// SPDX-License-Identifier: GPL-3.0-or-later
// Poses of a robot with a 2D scanner, by MRPT's ICP against the map that it builds.
#pragma once

#include <mrpt/obs/CObservation.h>
#include <mrpt/poses/CPose3D.h>

#include <memory>

namespace mapcodec {

/// CMetricMapBuilderICP over a points map. What MRPT throws passes through. Deterministic.
class ScanMatcher {
 public:
  ScanMatcher();
  ~ScanMatcher();
  /// The vehicle moved so since the last call, by its odometry: the first guess of the next match.
  void move(const mrpt::poses::CPose3D& step);
  /// @param scan  a 2D scan. @return T_map_vehicle.
  [[nodiscard]] mrpt::poses::CPose3D match(mrpt::obs::CObservation& scan);

 private:
  struct Builder;
  std::unique_ptr<Builder> builder_;
};

}  // namespace mapcodec
