// SPDX-License-Identifier: GPL-3.0-or-later
// Scans into a map of a service, each exactly once, whatever happens to the connection.
#pragma once

#include "slam_adapter/client/map_client.hpp"

namespace mapcodec {

struct SenderSettings {
  /// Scans of one writer are numbered, across connections and programs: the service knows which it has.
  /// Empty: scans that were on their way when a connection broke may be stored twice.
  std::string writer;
  std::uint64_t window_points = std::uint64_t{1}
                                << 20;  ///< sent and not acknowledged; `send` waits beyond it
  double retry_s = 60;                  ///< how long an unreachable or busy server is tried again
};

/// Threads: one sends.
class ScanSender {
 public:
  /// Errors: as MapClient; InvalidArgument (writer's name).
  [[nodiscard]] static Result<std::unique_ptr<ScanSender>> open(const MapClient& client,
                                                                const SenderSettings& settings);
  /// Waits for nothing; what was not acknowledged may be lost.
  ~ScanSender();
  ScanSender(const ScanSender&) = delete;
  ScanSender& operator=(const ScanSender&) = delete;

  /// Points that are not finite are left out. Large scans go in pieces. Returns when the scan is on its way.
  /// @param scan  `writer` and `sequence` are not used. Errors: those of the server; Unreachable, Busy (for
  /// longer than `retry_s`). After an error nothing more can be sent.
  [[nodiscard]] Status send(Scan scan);
  /// Waits until everything is durable. @return the newest revision that has a scan of this sender.
  [[nodiscard]] Result<std::uint64_t> finish();

  /// The last scan that is durable (counts pieces), and those sent.
  [[nodiscard]] std::uint64_t acknowledged() const;
  [[nodiscard]] std::uint64_t sent() const;
  /// How often the connection had to be made again.
  [[nodiscard]] std::uint64_t reconnects() const;

 private:
  struct Impl;
  explicit ScanSender(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec
