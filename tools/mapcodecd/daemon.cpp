// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/daemon.hpp"

#include <malloc.h>

#include <malloc.h>

#include <cstdio>
#include <thread>

#include "maps/service/catalogue.hpp"
#include "maps/service/token_access.hpp"
#include "slam_adapter/updater_coding.hpp"
#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/grpc/server.hpp"
#include "tools/mapcodecd/http/http_server.hpp"
#include "tools/mapcodecd/operations/logging.hpp"
#include "tools/mapcodecd/operations/metrics.hpp"
#include "tools/mapcodecd/operations/supervisor.hpp"

namespace mapcodec::daemon {
namespace {

/// Until told to stop. What commits freed lies scattered in the heap: if it were not given back now and then,
/// the resident memory of a service at an even load would creep up for hours.
void wait_for_stop(const std::atomic<bool>& stop) {
  constexpr auto kLook = std::chrono::milliseconds(50);
  constexpr int kLooksToTrim = 40;
  for (int looks = 1; !stop; looks = looks % kLooksToTrim + 1) {
    std::this_thread::sleep_for(kLook);
    if (looks == kLooksToTrim) ::malloc_trim(0);
  }
}

/// One address a line, in its place at once: whoever waits for the file finds it whole.
Status write_port_file(const std::string& path, const std::vector<std::string>& addresses) {
  if (path.empty()) return {};
  const std::string temporary = path + ".new";
  std::FILE* file = std::fopen(temporary.c_str(), "w");
  bool written = file != nullptr;
  for (const std::string& a : addresses) written = written && std::fprintf(file, "%s\n", a.c_str()) > 0;
  if (file != nullptr) written = std::fclose(file) == 0 && written;
  if (!written || std::rename(temporary.c_str(), path.c_str()) != 0)
    return make_error(ErrorCode::kCannotWrite, path + ": cannot be written");
  return {};
}

/// The line of a request, at the level that was asked for.
RecordRequest recorder(const LogSettings& settings) {
  return [level = settings.requests ? LogLevel::info : LogLevel::debug](const RequestRecord& r) {
    log_request(r, level);
  };
}

std::vector<GaugeSample> http_samples(const HttpListener::Figures& f) {
  const auto number = [](auto n) { return static_cast<double>(n); };
  return {{"mapcodec_http_connections", "Open connections.", number(f.connections)},
          {"mapcodec_http_waiting", "Requests that wait for a worker.", number(f.waiting)},
          {"mapcodec_http_busy_workers", "Workers that answer.", number(f.busy_workers)},
          {"mapcodec_http_accepted_total", "Connections so far.", number(f.accepted), true},
          {"mapcodec_http_evicted_total", "Connections that made room for others.", number(f.evicted), true},
          {"mapcodec_http_timed_out_total", "Connections that were too slow.", number(f.timed_out), true},
          {"mapcodec_http_refused_total", "Connections told 503.", number(f.refused), true}};
}

/// What carries calls to the service.
struct Servers {
  std::unique_ptr<HttpServer> http;
  std::unique_ptr<GrpcServer> grpc;  ///< nullptr without an address

  [[nodiscard]] Status start(const DaemonSettings& settings, MapService& service, AccessControl& access,
                             PrometheusMetrics& metrics) {
    const RecordRequest record = recorder(settings.log);
    const auto page = [this, &service, &metrics] {
      return metrics.text(&service, http_samples(http->figures()));
    };
    if (!settings.http.listen.empty()) {
      MAPCODEC_ASSIGN(http, HttpServer::start(settings.http, service, access, metrics, {page, record}));
    }
    if (!settings.grpc.listen.empty()) {
      MAPCODEC_ASSIGN(grpc, GrpcServer::start(settings.grpc, service, access, metrics, record));
    }
    return {};
  }
  /// gRPC's as they are; those of HTTP with a scheme before.
  [[nodiscard]] std::vector<std::string> addresses(bool tls) const {
    std::vector<std::string> all = grpc ? grpc->addresses() : std::vector<std::string>();
    for (const std::string& a : http ? http->addresses() : std::vector<std::string>()) {
      const bool socket = a.rfind("unix:", 0) == 0;
      all.push_back((socket ? "http+" : tls ? "https://" : "http://") + a);
    }
    return all;
  }
  void set_serving(bool serving) {
    if (grpc) grpc->set_serving(serving);
    if (http) http->set_serving(serving);
  }
  void stop(std::chrono::milliseconds time) {
    if (http) http->set_serving(false);
    if (grpc) grpc->stop(std::chrono::system_clock::now() + time);
    if (http) http->stop(std::chrono::steady_clock::now() + time);
  }
};

}  // namespace

Status run(const DaemonSettings& settings, const std::atomic<bool>& stop) {
  Arena arena;
  UpdateSettings update;
  update.cache_bytes = settings.editor_cache_bytes;
  UpdaterCoding coding(arena, update);
  PrometheusMetrics metrics;
  MAPCODEC_ASSIGN(const auto catalogue, Catalogue::open(catalogue_path(settings), settings.retention));
  TokenAccess access(*catalogue, settings.access.tokens, settings.access.limits);
  MAPCODEC_ASSIGN(const auto service, MapService::open(settings.service, coding, *catalogue, metrics));
  for (const MapEntry& m : service->list()) {
    if (!m.fault.empty())
      log_event(LogLevel::error, "map cannot be opened", {{"map", m.name}, {"error", m.fault}});
  }
  MAPCODEC_ASSIGN(const std::int64_t interrupted, catalogue->mark_interrupted_jobs());
  if (interrupted > 0)
    log_event(LogLevel::warn, "jobs of an earlier run were interrupted", {{"jobs", interrupted}});
  Servers servers;
  MAPCODEC_TRY(servers.start(settings, *service, access, metrics));
  servers.set_serving(true);
  const std::vector<std::string> addresses = servers.addresses(settings.http.tls.enabled());
  for (const std::string& a : addresses) log_event(LogLevel::info, "listening", {{"address", a}});
  MAPCODEC_TRY(write_port_file(settings.port_file, addresses));
  notify_ready("serving " + std::to_string(service->list().size()) + " maps");
  // It is well as long as the service answers at all: locks that are never given back show here.
  const Watchdog watchdog([&service] { return service->stats().maps < ~std::uint64_t{0}; });
  wait_for_stop(stop);
  log_event(LogLevel::info, "draining");
  notify_stopping();
  servers.stop(std::chrono::milliseconds(static_cast<std::int64_t>(1000 * settings.drain_s)));
  service->drain();
  log_event(LogLevel::info, "ended");
  return {};
}

}  // namespace mapcodec::daemon
