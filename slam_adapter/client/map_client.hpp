// SPDX-License-Identifier: GPL-3.0-or-later
// A map service as its C++ clients see it. No header of gRPC is needed to use this one.
//
//   auto client = MapClient::connect("mapcodec://127.0.0.1:7311/city");
//   client->create({.promise = PromiseKind::rms, .promise_m = 0.01});
//   auto sender = ScanSender::open(*client, "robot-7");     // scan_sender.hpp
//   sender->send({.points = scan, .T_submap_scan = pose});
//   sender->finish();
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "maps/compaction.hpp"
#include "maps/map_changes.hpp"
#include "maps/service/map_service.hpp"
#include "slam_adapter/client/map_url.hpp"

namespace mapcodec {

struct ClientSettings {
  std::string token;    ///< sent as "authorization: Bearer"; empty: none
  std::string ca_file;  ///< PEM; given: TLS, and the server's certificate must be signed by it
  std::string certificate_file, key_file;  ///< PEM, for servers that ask clients for one
  double timeout_s = 30;                   ///< of calls that are no streams, and for the connection
  double job_timeout_s = 3600;             ///< of calls that rewrite the map

  /// From MAPCODEC_TOKEN, MAPCODEC_CA, MAPCODEC_CERTIFICATE, MAPCODEC_KEY, MAPCODEC_TIMEOUT where they are
  /// set.
  [[nodiscard]] static ClientSettings from_environment();
};

/// A map's facts at a revision.
struct RemoteFacts {
  std::uint64_t revision = 0;
  std::int64_t timestamp_s = 0;
  MapInfo info;
};

/// A tile on its way.
struct RemoteTile {
  TileRecord record;  ///< segments have lengths and checksums; their offsets mean nothing
  ContentHash hash;   ///< of the content
  bool not_modified = false;
  std::vector<Bytes> segments;  ///< one for each of record.segments, checked
  std::vector<bool> sent;       ///< false: the client said that it has the segment; then its bytes are empty
  std::optional<unsigned> coarse;  ///< only the leading bytes, for this level of detail
};

struct TileRequest {
  std::string revision;  ///< empty: the newest
  TileSelection selection;
  std::vector<ContentHash> have, have_segments;
  std::optional<unsigned> coarse_level;
  std::uint64_t max_bytes = 0;
  bool without_bytes = false;
};

/// What a watcher is told: the way from what it has to a revision.
struct RemoteChanges {
  bool reset = false;               ///< `changes` are all tiles that there are
  std::vector<TileChange> changes;  ///< `tile` is not set
  RemoteFacts facts;
};

/// Threads: all methods from many at once. Errors of all: Unreachable (no server, deadline), Unauthenticated,
/// Denied, Busy, and those of the server's own methods (MapService).
class MapClient {
 public:
  /// Connects when it is first needed. Errors: InvalidArgument (url), NotFound, Malformed (certificates).
  [[nodiscard]] static Result<MapClient> connect(
      const std::string& url, const ClientSettings& settings = ClientSettings::from_environment());
  MapClient(MapClient&&) noexcept;
  MapClient& operator=(MapClient&&) noexcept;
  ~MapClient();

  [[nodiscard]] const MapUrl& url() const;

  [[nodiscard]] Status create(const NewMap& map, std::uint64_t keep_last = 0) const;
  [[nodiscard]] Result<std::vector<MapEntry>> list() const;
  [[nodiscard]] Status remove() const;
  [[nodiscard]] Result<MapStats> stats() const;
  /// Of the whole service; what is not in StatsReply stays 0.
  [[nodiscard]] Result<ServiceStats> service_stats() const;

  /// @param facts  may be nullptr. @param sink  is given each tile; an error of it ends the call.
  [[nodiscard]] Status tiles(const TileRequest& request, RemoteFacts* facts,
                             const std::function<Status(RemoteTile&&)>& sink) const;
  /// @param since  0: from nothing. @param once  ends with the newest revision.
  /// @param sink  is given each step; false ends the call. @param stop  becomes true: ends soon; may be
  /// nullptr.
  [[nodiscard]] Status watch(std::uint64_t since, bool once, const std::atomic<bool>* stop,
                             const std::function<Result<bool>(RemoteChanges&&)>& sink) const;

  [[nodiscard]] Result<std::uint64_t> set_poses(const std::vector<MapService::NamedPose>& poses) const;
  [[nodiscard]] Result<std::uint64_t> erase(const std::optional<Erasure>& e,
                                            const std::optional<std::string>& submap) const;
  [[nodiscard]] Result<std::uint64_t> snapshot(const std::string& name, bool remove = false) const;
  [[nodiscard]] Result<std::uint64_t> rollback(const std::string& revision) const;
  [[nodiscard]] Result<CompactReport> compact(std::uint64_t keep_last = 0) const;
  /// A whole archive as a new map.
  [[nodiscard]] Result<std::uint64_t> upload(const std::string& path) const;

  struct Connection;
  [[nodiscard]] const std::shared_ptr<Connection>& connection() const { return connection_; }

 private:
  explicit MapClient(std::shared_ptr<Connection> connection);
  std::shared_ptr<Connection> connection_;
};

}  // namespace mapcodec
