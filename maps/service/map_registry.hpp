// SPDX-License-Identifier: GPL-3.0-or-later
// The maps of the service's folder.
#pragma once

#include <map>
#include <set>
#include <shared_mutex>

#include "maps/service/map_worker.hpp"

namespace mapcodec {

/// One map: readers, the writer, and those who watch.
struct HostedMap {
  HostedMap(const std::string& map_name, const std::string& map_path, ServiceContext& context)
      : name(map_name),
        path(map_path),
        reader(name, path, context),
        worker(path, reader, watchers, context) {}

  const std::string name, path;
  MapReader reader;
  WatchList watchers;
  MapWorker worker;
  std::atomic<std::int64_t> last_use_ns{0};                              ///< steady clock
  std::atomic<std::uint64_t> compacted_revision{0}, compacted_bytes{0};  ///< after the last compaction
  std::atomic<bool> compacting{false};
  std::atomic<bool> wanted{false};  ///< since compaction in the background began: it gives way

  void touch() {
    last_use_ns = std::chrono::steady_clock::now().time_since_epoch().count();
    wanted = true;
  }
  [[nodiscard]] Result<MapViewPtr> view() { return reader.newest(worker.holds_archive()); }
};
using HostedMapPtr = std::shared_ptr<HostedMap>;

/// Threads: from many at once.
class MapRegistry {
 public:
  explicit MapRegistry(ServiceContext& context) : context_(context) {}

  /// Looks through the folder, removes what killed writers left and cuts off their unfinished commits.
  /// Errors: NotFound, Unreadable.
  [[nodiscard]] Status scan_folder();
  /// Errors: InvalidArgument (name), NotFound.
  [[nodiscard]] Result<HostedMapPtr> find(const std::string& name) const;
  [[nodiscard]] std::vector<HostedMapPtr> all() const;
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] std::string path_of(const std::string& name) const;

  /// Holds a name until the map is there, or is not made after all.
  class Claim {
   public:
    Claim(MapRegistry& registry, std::string name) : registry_(&registry), name_(std::move(name)) {}
    Claim(Claim&& other) noexcept
        : registry_(std::exchange(other.registry_, nullptr)), name_(std::move(other.name_)) {}
    ~Claim();
    void keep();

   private:
    MapRegistry* registry_;
    std::string name_;
  };
  /// Errors: InvalidArgument, Exists, LimitExceeded.
  [[nodiscard]] Result<Claim> claim(const std::string& name);
  /// @return the map, so that it can be closed outside of the lock. Errors: as find.
  [[nodiscard]] Result<HostedMapPtr> take_out(const std::string& name);
  void clear();

 private:
  ServiceContext& context_;
  mutable std::shared_mutex mutex_;
  std::map<std::string, HostedMapPtr> maps_;
  std::set<std::string> claimed_;
};

}  // namespace mapcodec
