// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <mutex>
#include <random>
#include <thread>

#include "slam_adapter/client/scan_sender.hpp"
#include "tools/bench/service.hpp"
#include "tools/peers/grid.hpp"

namespace mapcodec::bench {
namespace {

using Watch = peers::StopWatch;

constexpr double kStride = 1;                         // [m] between the scans of a writer
constexpr std::uint64_t kPlaces = 40, kVariants = 3;  // of a writer that comes to the same places

PoseChange pose_at(double x, double y, std::mt19937& random) {
  const double half = 0.01 * (double(random()) / 4294967296.0 - 0.5);
  PoseChange p;
  p.translation_m = {x, y, 0.02 * double(random()) / 4294967296.0};
  p.rotation_xyzw = {0, 0, std::sin(half), std::cos(half)};
  return p;
}

struct Shared {
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> points{0}, tiles{0}, bytes{0};
  std::mutex mutex;
  LoadResult result;

  void fault(const Error& e) {
    const std::lock_guard lock(mutex);
    result.faults.push_back(e.to_string());
    stop = true;
  }
};

void wait_until(double seconds, const Watch& watch) {
  const double early = seconds - watch.seconds();
  if (early > 0) std::this_thread::sleep_for(std::chrono::duration<double>(early));
}

/// What lies around a place is removed from the map.
Status clear(const MapClient& client, double x, double y) {
  Erasure around;
  around.sphere = Erasure::Sphere{{x, y, 0}, 10};
  const auto revision = client.erase(around, std::nullopt);
  return revision.ok() ? Status{} : Status(revision.error());
}

/// Sends until told to stop. Durable within a window: what is counted was acknowledged.
Status write(Shared& shared, const std::string& url, const PointCloud& scan, int number,
             const LoadSettings& s) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(url));
  SenderSettings sender_settings;
  sender_settings.writer = "writer-" + std::to_string(number);
  MAPCODEC_ASSIGN(const auto sender, ScanSender::open(client, sender_settings));
  std::mt19937 random(static_cast<unsigned>(number));
  const Watch watch(Watch::Kind::wall);
  std::uint64_t scans = 0;
  while (!shared.stop) {
    wait_until(s.scans_per_second > 0 ? double(scans) / s.scans_per_second : 0, watch);
    Scan message;
    message.points = scan;
    const double along = s.same_places ? double(scans % kPlaces) : double(scans);
    if (s.same_places) {
      // The map comes to an end: each place has a few poses, and now and then something is taken away.
      random.seed(static_cast<unsigned>(scans % (kPlaces * kVariants)));
      if (scans % kPlaces == kPlaces - 1) MAPCODEC_TRY(clear(client, kStride * along / 2, 200.0 * number));
    }
    message.T_submap_scan = pose_at(kStride * along, 200.0 * number, random);
    const Watch one(Watch::Kind::wall);
    MAPCODEC_TRY(sender->send(std::move(message)));
    ++scans;
    if (scans % 16 == 0) {
      MAPCODEC_TRY(sender->finish());
      const std::lock_guard lock(shared.mutex);
      shared.result.waits_s.push_back(one.seconds());
    }
  }
  MAPCODEC_TRY(sender->finish());
  shared.points += scans * scan.size();
  return {};
}

/// Pulls the tiles around random places, again and again.
Status read(Shared& shared, const std::string& url, int number, double per_second) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(url));
  std::mt19937 random(static_cast<unsigned>(100 + number));
  const Watch watch(Watch::Kind::wall);
  for (std::uint64_t fetches = 0; !shared.stop; ++fetches) {
    wait_until(per_second > 0 ? double(fetches) / per_second : 0, watch);
    TileRequest request;
    request.selection.sphere = {{double(random() % 100), 200.0 * double(random() % 4), 0}, 15};
    const auto take = [&](RemoteTile&& tile) -> Status {
      ++shared.tiles;
      for (const Bytes& b : tile.segments) shared.bytes += b.size();
      return {};
    };
    MAPCODEC_TRY(client.tiles(request, nullptr, take));
  }
  return {};
}

}  // namespace

Result<LoadResult> run_load(ChildDaemon& daemon, const std::string& map, const PointCloud& scan,
                            const LoadSettings& settings) {
  const std::string url = daemon.url(map);
  Shared shared;
  std::vector<std::thread> threads;
  const double cpu = daemon.cpu_seconds();
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(url));
  const Watch watch(Watch::Kind::wall);
  for (int i = 0; i < settings.writers; ++i)
    threads.emplace_back([&, i] {
      if (const Status s = write(shared, url, scan, i, settings); !s.ok()) shared.fault(s.error());
    });
  for (int i = 0; i < settings.readers; ++i)
    threads.emplace_back([&, i] {
      if (const Status s = read(shared, url, i, settings.fetches_per_second); !s.ok())
        shared.fault(s.error());
    });
  while (!shared.stop && watch.seconds() < settings.seconds) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    shared.result.resident_mb.push_back(daemon.resident_mb());
    const auto stats = client.stats();
    const auto service = client.service_stats();
    if (!stats.ok() || !service.ok()) continue;
    shared.result.stored_points.push_back(double(stats->points));
    shared.result.archive_mb.push_back(double(stats->file_bytes) / 1e6);
    shared.result.cache_mb.push_back(double(service->cache_bytes) / 1e6);
  }
  shared.stop = true;
  for (std::thread& t : threads) t.join();
  LoadResult r = std::move(shared.result);
  r.seconds = watch.seconds();
  r.points_per_second = double(shared.points) / r.seconds;
  r.tiles_read = shared.tiles;
  r.bytes_read = shared.bytes;
  r.daemon_cores = (daemon.cpu_seconds() - cpu) / r.seconds;
  MAPCODEC_ASSIGN(const MapStats stats, client.stats());
  r.revisions = stats.revision;
  return r;
}

}  // namespace mapcodec::bench
