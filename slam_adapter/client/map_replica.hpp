// SPDX-License-Identifier: GPL-3.0-or-later
// A copy of a map on a service, in an archive here, that fetches only what differs.
#pragma once

#include <map>

#include "maps/map_writer.hpp"
#include "slam_adapter/client/map_client.hpp"

namespace mapcodec {

struct ReplicaReport {
  std::uint64_t revision = 0;  ///< that the copy has now
  std::uint64_t tiles_fetched = 0, tiles_removed = 0;
  std::uint64_t bytes_fetched = 0;  ///< of segments
  std::uint64_t bytes_whole = 0;    ///< of all segments of the map
};

/// The archive has the server's facts, revisions by their numbers, and tiles bit for bit. Threads: one.
class MapReplica {
 public:
  /// Opens the copy at `path`; where there is none, it is begun by the first step.
  /// Errors: those of MapWriter::open.
  [[nodiscard]] static Result<MapReplica> open(const MapClient& client, const std::string& path);

  /// Fetches the whole map as it is now. Errors: as MapClient, MapWriter.
  [[nodiscard]] Result<ReplicaReport> catch_up();
  /// Goes on as the map changes, until `stop` or an error. @param told  after each step; false ends it.
  [[nodiscard]] Status follow(const std::atomic<bool>* stop,
                              const std::function<bool(const ReplicaReport&)>& told);
  /// Fetches the tiles around a place [m, map frame] only, and forgets others of them that are gone. A copy
  /// by pieces: its revisions are its own. @return nothing fetched and nothing changed: `revision` 0.
  [[nodiscard]] Result<ReplicaReport> fetch_around(const Vec3& centre, double radius_m);

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  MapReplica(const MapClient& client, std::string path)
      : connection_(client.connection()), client_(&client), path_(std::move(path)) {}
  [[nodiscard]] Result<ReplicaReport> apply(RemoteChanges&& changes);
  [[nodiscard]] Status begin(const RemoteFacts& facts);
  [[nodiscard]] Status put(const RemoteTile& tile, ReplicaReport& report);
  using Keys = std::vector<TileSelection::Key>;
  [[nodiscard]] Result<Keys> drop_and_list(const RemoteChanges& step, ReplicaReport& report);
  [[nodiscard]] Status fetch_keys(Keys keys, std::uint64_t revision, ReplicaReport& report);
  [[nodiscard]] Status end(const RemoteFacts& facts, bool own_number, ReplicaReport& report);
  void note_content();

  std::shared_ptr<MapClient::Connection> connection_;
  const MapClient* client_;  // must outlive this
  std::string path_;
  std::optional<MapWriter> writer_;
  std::map<ContentHash, SegmentRef> segments_;  // that the copy has
};

}  // namespace mapcodec
