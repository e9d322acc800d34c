// SPDX-License-Identifier: GPL-3.0-or-later
// What is answered to which path.
#pragma once

#include <atomic>

#include "maps/service/map_service.hpp"
#include "tools/mapcodecd/http/http_answer.hpp"
#include "tools/mapcodecd/http/http_server.hpp"
#include "tools/mapcodecd/http/map_index.hpp"

namespace mapcodec::daemon {

/// Threads: from many at once.
class MapRoutes {
 public:
  MapRoutes(MapService& service, AccessControl& access, ServiceMetrics& metrics, const HttpHooks& hooks)
      : service_(service), access_(access), metrics_(metrics), hooks_(hooks) {}

  [[nodiscard]] HttpAnswer answer(const HttpQuestion& question);
  void set_serving(bool serving) { serving_ = serving; }

 private:
  [[nodiscard]] HttpAnswer health() const;
  [[nodiscard]] HttpAnswer figures(const HttpQuestion& question);
  [[nodiscard]] HttpAnswer map_route(const HttpQuestion& question);
  [[nodiscard]] Result<HttpAnswer> index(const HttpQuestion& question, const std::string& map);
  [[nodiscard]] Result<HttpAnswer> tile(const HttpQuestion& question, const std::string& map,
                                        const std::string& key);
  [[nodiscard]] Result<HttpAnswer> tile_of(const HttpQuestion& question, const MapView& view,
                                           std::size_t tile);

  MapService& service_;
  AccessControl& access_;
  ServiceMetrics& metrics_;
  const HttpHooks& hooks_;
  MapIndexes indexes_;
  std::atomic<bool> serving_{false};
};

}  // namespace mapcodec::daemon
