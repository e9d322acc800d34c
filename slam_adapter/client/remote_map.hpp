// SPDX-License-Identifier: GPL-3.0-or-later
// The map around a robot, from a service: a LocalMap over a copy on local disk that fetches what comes near.
#pragma once

#include "slam_adapter/client/map_client.hpp"
#include "slam_adapter/local_map.hpp"

namespace mapcodec {

struct RemoteMapSettings {
  LocalMapSettings local;
  std::string cache_file;   ///< archive of the tiles that were fetched; stays for the next time
  double look_every_s = 1;  ///< how often the server is asked what changed near the robot
};

struct RemoteMapState {
  bool online = false;         ///< the last question to the server was answered
  std::string fault;           ///< why not
  std::uint64_t revision = 0;  ///< of the server, as last seen
  std::uint64_t tiles_fetched = 0, bytes_fetched = 0;
};

/// Works on with what it has when the server is away, and catches up afterwards.
/// Threads: all methods from many at once.
class RemoteMap {
 public:
  /// Begins with the cache where there is one; else waits for the server.
  /// @param arena  must outlive the map. Errors: as MapClient (without a cache), LocalMap::over.
  [[nodiscard]] static Result<std::unique_ptr<RemoteMap>> open(const std::string& url,
                                                               const RemoteMapSettings& settings,
                                                               Arena& arena);
  ~RemoteMap();
  RemoteMap(const RemoteMap&) = delete;
  RemoteMap& operator=(const RemoteMap&) = delete;

  /// As LocalMap::move_to; what is not here yet is fetched in the background.
  [[nodiscard]] Status move_to(const MapPose& T_map_robot, std::optional<double> stamp_s = std::nullopt);
  /// For views, nearest points and waiting.
  [[nodiscard]] const LocalMap& local() const;
  [[nodiscard]] RemoteMapState state() const;
  /// Waits until the tiles around the last pose were asked for and are here, or the server did not answer.
  /// @return whether they are here.
  [[nodiscard]] bool wait_fetched(double timeout_s) const;

 private:
  struct Impl;
  explicit RemoteMap(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec
