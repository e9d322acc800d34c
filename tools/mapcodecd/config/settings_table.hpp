// SPDX-License-Identifier: GPL-3.0-or-later
// Every key of the configuration once: its section, name, place, range and meaning. What reads, prints or
// lists the configuration is a visitor of this table.
#pragma once

#include <cstdint>
#include <limits>

#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

/// Smallest and largest value of a number.
struct Range {
  double least = 0, most = 1e18;
};

/// Calls `v.section(name, meaning)` and `v.value(key, place, meaning, range)` for all of them, in order.
template <class Settings, class Visitor>
void visit_storage(Settings& s, Visitor& v) {
  constexpr Range kTime{0, 86400 * 365};
  v.section("storage", "Where the maps lie, and what is held of them in memory.");
  v.value("folder", s.service.folder, "Folder of the archives NAME.mapc; must exist.", Range{});
  v.value("cache_bytes", s.service.cache_bytes, "Hot tiles in memory.", Range{0, 1e15});
  v.value("max_maps", s.service.max_maps, "More are not created.", Range{1, 1e7});
  v.value("max_editors", s.service.max_editors, "Maps that are written to at the same time.", Range{1, 1e5});
  v.value("editor_cache_bytes", s.editor_cache_bytes, "What is known of a map that is written to.",
          Range{0, 1e15});
  v.value("editor_idle_s", s.service.editor_idle_s, "After this rest a map's writer is closed.", kTime);

  v.section("commits", "How scans become revisions.");
  v.value("queue_points", s.service.queue_points, "Points that wait for a commit, over all maps; then: busy.",
          Range{1, 1e12});
  v.value("commit_points", s.service.commit_points, "A commit takes about so many points at most.",
          Range{1, 1e12});
  v.value("commit_after_s", s.service.commit_after_s, "Scans wait so long for others to share a commit.",
          kTime);
  v.value("max_scan_points", s.service.max_scan_points, "Points of one scan.", Range{1, 1e9});

  v.section("compaction", "Rewriting archives without what nobody needs, when there is no traffic.");
  v.value("idle_s", s.service.compact_idle_s, "Only after so long without traffic; 0: never.", kTime);
  v.value("dead_share", s.service.compact_dead_share, "Share of a file that no kept revision needs.",
          Range{0.01, 1});
  v.value("must_share", s.service.compact_must_share,
          "Share from which calls wait for it, if traffic never rests; 1: never.", Range{0.01, 1});
  v.value("must_bytes", s.service.compact_must_bytes, "Not before so many bytes are dead.", Range{0, 1e15});
  v.value("keep_last", s.retention.keep_last,
          "Newest revisions kept beside snapshots, where a map has no own rule.", Range{1, 1e12});
}

template <class Settings, class Visitor>
void visit_transports(Settings& s, Visitor& v) {
  constexpr Range kSeconds{0.001, 86400};
  v.section("grpc",
            "Maps, scans, tiles. Addresses: HOST:PORT with a number as host, or unix:/PATH (mode 0600).");
  v.value("listen", s.grpc.listen, "Loopback unless told otherwise; port 0 takes a free one.", Range{});
  v.value("max_message_bytes", s.grpc.max_message_bytes, "Longest message that is read.",
          Range{1024, 1 << 30});
  v.value("memory_bytes", s.grpc.memory_bytes, "Buffers of all connections; then calls are cut off.",
          Range{1 << 20, 1e15});
  v.value("max_connections", s.grpc.max_connections, "At once; more are closed.", Range{1, 1e6});
  v.value("max_streams_per_connection", s.grpc.max_streams_per_connection, "Calls at once on one connection.",
          Range{1, 1e5});
  v.value("stream_window_points", s.grpc.stream_window_points,
          "Points of one Insert stream that wait for a commit.", Range{1, 1e12});
  v.value("idle_stream_s", s.grpc.idle_stream_s, "An Insert stream that sends nothing for so long ends.",
          kSeconds);
  v.value("idle_connection_s", s.grpc.idle_connection_s, "A connection without a call for so long ends.",
          kSeconds);
  v.value("handshake_s", s.grpc.handshake_s, "For the beginning of a connection.", kSeconds);
  v.value("workers", s.grpc.workers, "Threads for calls that wait or decode.", Range{1, 1024});
  v.value("waiting_calls", s.grpc.waiting_calls, "Calls that wait for such a thread; then: busy.",
          Range{1, 1e6});

  v.section("http", "GET /maps/MAP/tiles/KEY, /maps/MAP/index, /metrics, /healthz.");
  v.value("listen", s.http.listen, "As grpc.listen; [] for none.", Range{});
  v.value("workers", s.http.workers, "Threads that answer; a slow reader holds one for write_timeout_s.",
          Range{1, 4096});
  v.value("max_connections", s.http.max_connections, "Then the one that rested longest makes room.",
          Range{1, 1e6});
  v.value("max_waiting", s.http.max_waiting, "Requests that wait for a thread; then: 503.", Range{1, 1e6});
  v.value("read_timeout_s", s.http.read_timeout_s, "For a whole request.", kSeconds);
  v.value("idle_timeout_s", s.http.idle_timeout_s, "Between two requests of a connection.", kSeconds);
  v.value("write_timeout_s", s.http.write_timeout_s, "For a whole answer.", kSeconds);
  v.value("max_header_bytes", s.http.max_header_bytes, "Of one request.", Range{256, 1 << 20});
}

template <class Settings, class Visitor>
void visit_security(Settings& s, Visitor& v) {
  v.section("tls", "PEM files, for all addresses but sockets; read once at the start.");
  v.value("certificate_file", s.grpc.tls.certificate_file, "Chain of the server; empty: plain text.",
          Range{});
  v.value("key_file", s.grpc.tls.key_file, "Its private key.", Range{});
  v.value("client_ca_file", s.grpc.tls.client_ca_file, "If given, clients need a certificate signed by it.",
          Range{});
  v.value("insecure", s.grpc.insecure, "Allows plain text beyond loopback: tokens can then be overheard.",
          Range{});

  v.section("access", "Tokens are managed with: mapcodecd token add|list|revoke");
  v.value("tokens", s.access.tokens,
          "\"remote\": those on this machine need none; \"required\": everybody needs one.", Range{});
  v.value("catalogue", s.access.catalogue, "SQLite file; empty: catalogue.db in the folder of the maps.",
          Range{});

  constexpr Range kAmount{0, 1e15};
  v.section("limits", "For one client, which is a token's name or \"local\"; 0: none.");
  v.value("requests_per_s", s.access.limits.requests_per_s, "On the average.", kAmount);
  v.value("request_burst", s.access.limits.request_burst, "At once, after a rest.", kAmount);
  v.value("bytes_per_s", s.access.limits.bytes_per_s, "In both directions together, on the average.",
          kAmount);
  v.value("byte_burst", s.access.limits.byte_burst, "At once, after a rest.", kAmount);
  v.value("open_streams", s.access.limits.open_streams, "At the same time.", kAmount);
}

template <class Settings, class Visitor>
void visit_settings(Settings& s, Visitor& v) {
  visit_storage(s, v);
  visit_transports(s, v);
  visit_security(s, v);
  v.section("log", "To stderr.");
  v.value("level", s.log.level, "trace, debug, info, warn, error or off.", Range{});
  v.value("json", s.log.json, "One JSON object a line.", Range{});
  v.value("requests", s.log.requests, "A line for every request at level info; else at debug.", Range{});
  v.section("daemon", "Start and end.");
  v.value("drain_s", s.drain_s, "After SIGTERM; then calls that still run are cut off.", Range{0, 86400});
  v.value("port_file", s.port_file,
          "Where the addresses that were bound are written, one a line; empty: nowhere.", Range{});
}

}  // namespace mapcodec::daemon
