// SPDX-License-Identifier: GPL-3.0-or-later
// Tiles, figures and health over HTTP. No header of cpp-httplib is needed to use this one.
//
//   GET /maps/MAP/tiles/KEY  the segments of a tile, one after the other: Mapcodec-Segments has their
//   lengths.
//                            KEY: LEVEL_X_Y_Z (tile_path.hpp). ?revision=NUMBER|SNAPSHOT. ETag,
//                            If-None-Match, Range
//   GET /maps/MAP/index      JSON: facts and tiles of the map. ?revision=. ETag, If-None-Match, Range
//   GET /metrics             for Prometheus
//   GET /healthz             200 while the daemon serves, 503 while it starts or drains; needs no token
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "maps/service/access.hpp"
#include "maps/service/map_service.hpp"
#include "tools/mapcodecd/http/http_listener.hpp"
#include "tools/mapcodecd/request_record.hpp"

namespace mapcodec::daemon {

/// What the server needs beside the maps.
struct HttpHooks {
  std::function<std::string()> metrics_text;  ///< the page /metrics
  RecordRequest record;                       ///< may be empty
};

/// Threads: methods from any.
class HttpServer {
 public:
  /// @param service, access, metrics  must outlive the server. Errors: as HttpListener::start.
  [[nodiscard]] static Result<std::unique_ptr<HttpServer>> start(const HttpSettings& settings,
                                                                 MapService& service, AccessControl& access,
                                                                 ServiceMetrics& metrics, HttpHooks hooks);
  ~HttpServer();

  /// What was bound, ports filled in.
  [[nodiscard]] const std::vector<std::string>& addresses() const;
  [[nodiscard]] HttpListener::Figures figures() const;
  /// What /healthz says.
  void set_serving(bool serving);
  void stop(SteadyTime deadline);

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec::daemon
