// SPDX-License-Identifier: GPL-3.0-or-later
// Follows a vehicle through a log by registering its scans in the map that grows of them.
#pragma once

#include <memory>
#include <string>

#include "slam_adapter/mrpt/log_mapper.hpp"
#include "slam_adapter/mrpt/map_progress.hpp"

namespace mapcodec {

/// Threads: one at a time.
class LogTracker {
 public:
  /// @param arena  must outlive the tracker.
  LogTracker(std::string map_path, Registrar registrar, std::uint64_t memory_bytes, Arena& arena);
  ~LogTracker();

  /// Goes on from here.
  void set_state(const std::optional<TrackState>& state) { state_ = state; }
  [[nodiscard]] const std::optional<TrackState>& state() const { return state_; }

  /// @param scan  [m, vehicle frame]; its frame's stamp and odometry tell where it may be.
  /// @return T_map_vehicle; nothing if the scan could not be registered (the way is then guessed on).
  /// The first scan lies at the origin. Errors: those of LocalMap.
  [[nodiscard]] Result<std::optional<MapPose>> track(const RawlogFrame& frame, const PointCloud& scan);

 private:
  [[nodiscard]] MapPose guess(const RawlogFrame& frame) const;
  [[nodiscard]] Result<std::shared_ptr<const LocalMapView>> around(const MapPose& pose);
  void remember(const RawlogFrame& frame, const MapPose& pose);

  std::string path_;
  Registrar registrar_;
  std::uint64_t memory_bytes_;
  Arena& arena_;
  std::unique_ptr<LocalMap> map_;
  std::optional<TrackState> state_;
};

}  // namespace mapcodec
