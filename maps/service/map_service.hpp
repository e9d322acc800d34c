// SPDX-License-Identifier: GPL-3.0-or-later
// The maps of one folder, served to many at once. Knows no network: what carries calls is in tools/mapcodecd.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "maps/compaction.hpp"
#include "maps/map_archive.hpp"
#include "maps/map_changes.hpp"
#include "maps/service/map_catalogue.hpp"
#include "maps/service/map_coding.hpp"
#include "maps/service/service_metrics.hpp"

namespace mapcodec {

struct ServiceSettings {
  std::string folder;                                    ///< of the archives NAME.mapc; must exist
  std::uint64_t cache_bytes = std::uint64_t{256} << 20;  ///< of segments that were read
  std::uint64_t queue_points = std::uint64_t{8} << 20;   ///< that wait for a commit, over all maps
  std::uint64_t commit_points = std::uint64_t{1} << 20;  ///< a commit takes about so many at most
  double commit_after_s = 0.02;                          ///< scans wait so long for others to share a commit
  std::size_t max_maps = 10000;
  std::size_t max_editors = 64;     ///< maps that are written to at the same time
  double editor_idle_s = 60;        ///< then its memory and its lock are given back
  double compact_idle_s = 30;       ///< no traffic for so long before a map is compacted; 0: never
  double compact_dead_share = 0.5;  ///< of the file that no kept revision needs
  double compact_must_share = 0.8;  ///< then it is compacted though there is traffic, which waits; 1: never
  std::uint64_t compact_must_bytes = std::uint64_t{64} << 20;  ///< nor before so many dead bytes
  std::uint64_t max_scan_points = std::uint64_t{1} << 22;      ///< in one scan
};

/// A map at one revision, for as long as somebody holds it.
struct MapView {
  std::string name;
  std::shared_ptr<const MapArchive> archive;
  MapSchema schema;
  std::uint64_t file = 0;  ///< changes when compaction replaces the archive's file
};
using MapViewPtr = std::shared_ptr<const MapView>;

struct MapEntry {
  std::string name;
  std::uint64_t revision = 0, tiles = 0, points = 0, bytes = 0;
  std::int64_t timestamp_s = 0;
  std::string fault;  ///< why it cannot be opened; else empty
};

/// One scan on its way into a map.
struct Scan {
  PointCloud points;                        ///< [m, frame of the scan]
  std::string submap;                       ///< empty: the map's own points
  std::optional<PoseChange> T_submap_scan;  ///< where the scan was taken; its `submap` is not used
  std::optional<PoseChange> T_map_submap;   ///< where the submap lies from now on
  std::string writer;          ///< who sends it; with a sequence number a scan that comes twice counts once
  std::uint64_t sequence = 0;  ///< per writer, from 1, without gaps; 0: none
  std::uint64_t acknowledged =
      0;  ///< of this writer, as it says itself: a scan that added nothing leaves no trace
};

/// After the commit that made a scan durable.
struct ScanReceipt {
  std::uint64_t revision = 0;
  bool repeated = false;  ///< had been committed before
};

/// Tiles that are asked for. Nothing set: all.
struct TileSelection {
  struct Key {
    std::uint32_t submap = 0;
    TileKey key;
  };
  std::vector<Key> keys;
  std::optional<Box> box;  ///< [m, map frame]
  struct Sphere {
    Vec3 centre{0, 0, 0};  ///< [m, map frame]
    double radius_m = 0;
  };
  std::optional<Sphere> sphere;  ///< the nearest tiles first
};

/// Of one map, or of all together.
struct MapStats {
  std::uint64_t revision = 0, tiles = 0, points = 0, live_bytes = 0, file_bytes = 0;
  std::uint64_t queued_scans = 0, queued_points = 0;
  bool editing = false, compacting = false;
};
struct ServiceStats {
  std::uint64_t maps = 0, editors = 0;
  std::uint64_t queued_scans = 0, queued_points = 0, queue_limit_points = 0;
  std::uint64_t cache_bytes = 0, cache_limit_bytes = 0, cache_hits = 0, cache_misses = 0;
  std::uint64_t watchers = 0, compacting = 0;
  bool draining = false;
};

struct CompactJob {
  std::optional<std::uint64_t> keep_last;  ///< nothing: as the catalogue says
};

/// Threads: all methods from many at once. Methods that say *waits* are for threads that may block. All take
/// the map's name; where it is not valid: InvalidArgument; where there is none: NotFound.
class MapService {
 public:
  /// Opens the folder: removes what killed writers left, and looks at the last commit of each archive. A map
  /// that cannot be opened is listed with its fault; it does not keep the others away.
  /// @param coding, catalogue, metrics  must outlive the service.
  /// Errors: NotFound, Unreadable, CannotWrite (folder).
  [[nodiscard]] static Result<std::unique_ptr<MapService>> open(const ServiceSettings& settings,
                                                                MapCoding& coding, MapCatalogue& catalogue,
                                                                ServiceMetrics& metrics);
  /// Drains.
  ~MapService();
  MapService(const MapService&) = delete;
  MapService& operator=(const MapService&) = delete;

  [[nodiscard]] std::vector<MapEntry> list() const;
  /// Waits. Errors: Exists, InvalidArgument, Unsupported, LimitExceeded (maps), CannotWrite.
  [[nodiscard]] Status create(const std::string& name, const NewMap& map, const Retention& retention,
                              const std::string& principal);
  /// Takes the archive at `path`, on the same file system, as a new map: it is verified and renamed. Waits.
  /// Errors: as create; those of MapArchive::open; ArchiveDamaged, ChecksumMismatch.
  [[nodiscard]] Status adopt(const std::string& name, const std::string& path, const std::string& principal);
  /// Waits for the commit at work. Readers go on with what they have open.
  [[nodiscard]] Status remove(const std::string& name);

  /// The newest revision; opened once per revision. Errors: as MapArchive::open.
  [[nodiscard]] Result<MapViewPtr> view(const std::string& name) const;
  /// @param revision  a number or the name of a snapshot; empty: the newest. Errors: as view; NotFound.
  [[nodiscard]] Result<MapViewPtr> view(const std::string& name, const std::string& revision) const;
  /// The view of a file that compaction may have replaced meanwhile, while readers still need it.
  /// Errors: NotFound (no longer there: open again).
  [[nodiscard]] Result<MapViewPtr> view_of_file(const std::string& name, std::uint64_t file) const;

  /// Indices into view.archive->tiles(), in the order in which they should be sent. Keys without a tile are
  /// left out. Errors: InvalidArgument (NaN, radius).
  [[nodiscard]] static Result<std::vector<std::size_t>> select(const MapView& view,
                                                               const TileSelection& selection);
  /// The segments of a tile, checked, from the cache where they are in it. Errors: as MapArchive::read.
  [[nodiscard]] Result<std::vector<std::shared_ptr<const Bytes>>> segments(const MapView& view,
                                                                           std::size_t tile) const;

  /// Queues a scan; returns at once. `done` is called once, from a thread of the service, after the commit
  /// that has it, or with the error that kept it out; it must not wait.
  /// Errors (then `done` is not called): Malformed, InvalidArgument (channels, sizes, a coordinate beyond
  /// what doubles of metres mean), LimitExceeded, Busy (queue full, draining), Unsupported.
  [[nodiscard]] Status insert(const std::string& name, Scan scan,
                              std::function<void(const Result<ScanReceipt>&)> done);
  /// How long somebody who was told Busy should wait [ms].
  [[nodiscard]] std::uint64_t retry_after_ms() const;
  /// Number of the last scan of `writer` that is in the map; 0: none.
  [[nodiscard]] Result<std::uint64_t> last_sequence(const std::string& name, const std::string& writer) const;

  struct NamedPose {
    std::string submap;
    PoseChange pose;  ///< its `submap` is not used
  };
  /// All wait, go through the map's queue, and return the revision they made. Errors: as MapWriter; Busy.
  [[nodiscard]] Result<std::uint64_t> set_poses(const std::string& name, std::vector<NamedPose> poses);
  [[nodiscard]] Result<std::uint64_t> erase(const std::string& name, std::optional<Erasure> erasure,
                                            std::optional<std::string> submap);
  /// @param revision  0: the newest. @return the revision that bears the name.
  [[nodiscard]] Result<std::uint64_t> snapshot(const std::string& name, const std::string& snapshot);
  [[nodiscard]] Result<std::uint64_t> remove_snapshot(const std::string& name, const std::string& snapshot);
  [[nodiscard]] Result<std::uint64_t> rollback(const std::string& name, const std::string& revision);
  [[nodiscard]] Result<CompactReport> compact(const std::string& name, const CompactJob& job);

  /// Calls `changed` from a thread of the service whenever the map has a new revision or goes away, until
  /// the watcher (watch_list.hpp) is destroyed. `changed` must neither wait nor destroy a watcher.
  class Watcher;
  [[nodiscard]] Result<std::unique_ptr<Watcher>> watch(const std::string& name,
                                                       std::function<void()> changed);

  [[nodiscard]] Result<MapStats> stats(const std::string& name) const;
  [[nodiscard]] ServiceStats stats() const;
  [[nodiscard]] const ServiceSettings& settings() const;
  [[nodiscard]] const MapCoding& coding() const;

  /// From now on nothing is taken in; what is queued is committed, then all archives are closed. Waits.
  void drain();

 private:
  struct Impl;
  explicit MapService(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// 1 to 100 letters, digits, '-', '_' and '.', the first a letter, a digit or '_'. Nothing else becomes a
/// file name.
[[nodiscard]] bool is_map_name(const std::string& name);

}  // namespace mapcodec
