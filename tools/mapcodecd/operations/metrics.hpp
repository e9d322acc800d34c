// SPDX-License-Identifier: GPL-3.0-or-later
// What the daemon counts, as the text that Prometheus reads.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "maps/service/map_service.hpp"
#include "maps/service/service_metrics.hpp"

namespace mapcodec::daemon {

/// A figure of the moment that somebody else knows.
struct GaugeSample {
  const char* name = "";  ///< "mapcodec_http_connections"
  const char* help = "";
  double value = 0;
  bool counter = false;  ///< only ever grows
};

/// Threads: from many at once. Beyond 1000 maps the figures of single maps are left out: each would be a
/// series.
class PrometheusMetrics final : public ServiceMetrics {
 public:
  PrometheusMetrics();
  ~PrometheusMetrics() override;

  void add(Counter counter, double amount) override;
  void request(std::string_view transport, std::string_view method, std::string_view code,
               double seconds) override;
  void commit(double seconds, std::uint64_t scans) override;

  /// The page [Prometheus text format 0.0.4]: what was counted, what the service says of the moment, the
  /// process, and `more`.
  [[nodiscard]] std::string text(const MapService* service, const std::vector<GaugeSample>& more = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec::daemon
