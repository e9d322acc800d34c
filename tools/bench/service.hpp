// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of bench_service.
#pragma once

#include <sys/types.h>

#include "mapcodec/cloud/point_cloud.hpp"
#include "tools/bench/report.hpp"
#include "tools/bench/update.hpp"

namespace mapcodec::bench {

/// A mapcodecd of its own, on a free port of loopback, over an empty folder.
class ChildDaemon {
 public:
  /// @param folder  is emptied. @param config  what is to be as not usual, in TOML. Errors: NotFound (no
  /// mapcodecd beside this program), Unreachable.
  [[nodiscard]] static Result<ChildDaemon> start(const std::string& folder, const std::string& config = "");
  ChildDaemon(ChildDaemon&& other) noexcept;
  ChildDaemon& operator=(ChildDaemon&&) = delete;
  ~ChildDaemon();
  [[nodiscard]] std::string url(const std::string& map) const { return "mapcodec://" + address_ + "/" + map; }
  [[nodiscard]] double resident_mb() const;
  [[nodiscard]] double cpu_seconds() const;  ///< user and system, so far
  /// SIGTERM. @return whether it ended in order.
  [[nodiscard]] bool stop();

 private:
  ChildDaemon() = default;
  pid_t pid_ = -1;
  std::string address_, folder_;
};

struct LoadSettings {
  int writers = 4, readers = 8;
  double seconds = 30;
  double scans_per_second = 0;    ///< of each writer; 0: as fast as it goes
  double fetches_per_second = 0;  ///< of each reader; 0: as fast as it goes
  bool same_places = false;       ///< the writers come to the same places again and again
};
struct LoadResult {
  double seconds = 0, points_per_second = 0;
  std::uint64_t revisions = 0, tiles_read = 0, bytes_read = 0;
  double daemon_cores = 0;
  std::vector<double> waits_s;                    ///< from a scan's sending until it is durable
  std::vector<double> resident_mb;                ///< each second
  std::vector<double> stored_points, archive_mb;  ///< of the map, each second
  std::vector<double> cache_mb;                   ///< segments that the daemon holds, each second
  std::vector<std::string> faults;
};
/// Writers put scans of a spinning lidar in while readers pull tiles.
[[nodiscard]] Result<LoadResult> run_load(ChildDaemon& daemon, const std::string& map, const PointCloud& scan,
                                          const LoadSettings& settings);

/// Tiles of 64 kB through the service beside a bare stream of the same bytes, in one process.
[[nodiscard]] Status measure_fetch(const BenchSettings& settings, Report& report);
/// What a client with an old copy fetches.
[[nodiscard]] Status measure_sync(const BenchSettings& settings, const PointCloud& scan, Report& report);

}  // namespace mapcodec::bench
