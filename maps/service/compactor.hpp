// SPDX-License-Identifier: GPL-3.0-or-later
// Compaction in the background, when nobody needs the map.
#pragma once

#include <condition_variable>
#include <thread>

#include "maps/service/map_registry.hpp"

namespace mapcodec {

/// Looks at the maps once a second. A map that nobody used for a while, and of whose file a large share is
/// dead or whose tiles have segments to be folded, is compacted; a call to the map stops that, and it is
/// tried again later. Where traffic never rests and nearly all of the file is dead, calls have to wait for
/// it.
class Compactor {
 public:
  Compactor(MapRegistry& registry, ServiceContext& context);
  ~Compactor() { stop(); }
  /// Ends what is at work with Cancelled, for good.
  void stop();

  /// Compacts now, through the map's queue. Waits. @param gives_way  a call to the map ends it with
  /// Cancelled.
  [[nodiscard]] Result<CompactReport> compact(HostedMap& map, const CompactJob& job, bool gives_way);

 private:
  void watch();
  enum class Due { no, at_rest, now };
  [[nodiscard]] Due due(HostedMap& map) const;
  [[nodiscard]] Status fold(const std::string& path, const std::atomic<bool>& stop) const;
  void compact_quietly(HostedMap& map, bool gives_way);

  MapRegistry& registry_;
  ServiceContext& context_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

/// Bytes of the segments of a revision's tiles.
[[nodiscard]] std::uint64_t live_bytes(const MapArchive& archive);

}  // namespace mapcodec
