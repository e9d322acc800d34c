// SPDX-License-Identifier: GPL-3.0-or-later
// What the service tells whoever counts. Figures of the moment (tiles, queue, cache, revision) are not told
// but asked for: MapService::stats.
#pragma once

#include <cstdint>
#include <string_view>

namespace mapcodec {

/// Threads: from many at once; must not block.
class ServiceMetrics {
 public:
  enum class Counter : std::uint8_t {
    bytes_in,            ///< payload of requests
    bytes_out,           ///< payload of answers
    points_in,           ///< finite points of scans that were committed
    scans_in,            ///< scans that were committed
    tiles_out,           ///< tiles whose bytes were sent
    tiles_not_modified,  ///< tiles that the client had
    commits,
    commit_failures,
    busy,  ///< refused because a queue was full
    compactions,
    compactions_stopped,  ///< gave way to traffic
    compaction_failures,
  };
  static constexpr std::size_t kCounters = 12;

  virtual ~ServiceMetrics() = default;
  virtual void add(Counter counter, double amount = 1) = 0;
  /// One call that has ended. @param transport  "grpc", "http". @param code  "OK", "NOT_FOUND", ... or "200".
  virtual void request(std::string_view transport, std::string_view method, std::string_view code,
                       double seconds) = 0;
  /// One commit. @param seconds  from the first scan taken from the queue to the end of the commit.
  virtual void commit(double seconds, std::uint64_t scans) = 0;
};

/// Counts nothing.
class NoMetrics final : public ServiceMetrics {
 public:
  void add(Counter, double) override {}
  void request(std::string_view, std::string_view, std::string_view, double) override {}
  void commit(double, std::uint64_t) override {}
};

}  // namespace mapcodec
