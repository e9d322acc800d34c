// SPDX-License-Identifier: GPL-3.0-or-later
// Everything that mapcodecd can be told.
#pragma once

#include <string>
#include <vector>

#include "maps/service/client_limits.hpp"
#include "maps/service/map_service.hpp"
#include "maps/service/token_policy.hpp"

namespace mapcodec::daemon {

struct TlsSettings {
  std::string certificate_file, key_file;  ///< PEM; both empty: plain text
  std::string client_ca_file;              ///< PEM; given: clients need a certificate signed by it
  [[nodiscard]] bool enabled() const { return !certificate_file.empty(); }
};

struct GrpcSettings {
  /// "127.0.0.1:7311", "[::1]:0" (a free port), "unix:/run/mapcodecd.sock" (made with mode 0600).
  std::vector<std::string> listen{"127.0.0.1:7311"};
  TlsSettings tls;        ///< of the ports that are no sockets
  bool insecure = false;  ///< plain text beyond loopback
  std::uint64_t max_message_bytes = std::uint64_t{16} << 20;
  std::uint64_t memory_bytes = std::uint64_t{512} << 20;  ///< of buffers of all connections
  std::uint32_t max_connections = 1000;
  std::uint32_t max_streams_per_connection = 64;
  std::uint64_t stream_window_points = std::uint64_t{1} << 19;  ///< of one Insert stream, not yet committed
  double idle_stream_s = 60;                                    ///< an Insert stream that sends nothing ends
  double idle_connection_s = 300;                               ///< a connection without a call ends
  double handshake_s = 5;
  unsigned workers = 4;             ///< threads for calls that wait or decode
  std::size_t waiting_calls = 256;  ///< for a worker; more are told Busy
};

/// Tiles, figures and health over HTTP.
struct HttpSettings {
  std::vector<std::string> listen{"127.0.0.1:7380"};  ///< as GrpcSettings::listen; empty: no HTTP
  TlsSettings tls;                                    ///< of the ports that are no sockets
  bool insecure = false;                              ///< plain text beyond loopback
  unsigned workers = 64;               ///< threads; a slow reader holds one for write_timeout_s
  std::size_t max_connections = 4096;  ///< when all are taken, the one that rested longest makes room
  std::size_t max_waiting = 1024;      ///< requests that wait for a worker; more are told 503
  double read_timeout_s = 2;           ///< from the first byte of a request to its last
  double idle_timeout_s = 30;          ///< between requests of one connection
  double write_timeout_s = 20;         ///< for a whole answer
  std::size_t max_header_bytes = 16384;
};

struct AccessSettings {
  std::string catalogue;  ///< SQLite file; empty: catalogue.db in the folder of the maps
  TokenPolicy tokens = TokenPolicy::remote;
  LimitSettings limits;
};

struct LogSettings {
  std::string level = "info";  ///< trace, debug, info, warn, error, off
  bool json = false;           ///< one JSON object a line
  bool requests = true;        ///< a line for every request at level info; else at debug
};

struct DaemonSettings {
  ServiceSettings service;
  GrpcSettings grpc;
  std::uint64_t editor_cache_bytes = std::uint64_t{128}
                                     << 20;  ///< of what is known of a map that is written to
  HttpSettings http;
  AccessSettings access;
  LogSettings log;
  Retention retention;    ///< of maps that have none of their own
  double drain_s = 30;    ///< after SIGTERM: then calls that still run are cut off
  std::string port_file;  ///< where the ports that were bound are written, one address a line; empty: nowhere
};

}  // namespace mapcodec::daemon
