// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/daemon.hpp"

#include <spdlog/spdlog.h>

#include <cstdio>
#include <thread>

#include "slam_adapter/updater_coding.hpp"
#include "tools/mapcodecd/grpc/server.hpp"

namespace mapcodec::daemon {
namespace {

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

}  // namespace

Status run(const DaemonSettings& settings, const std::atomic<bool>& stop) {
  Arena arena;
  UpdateSettings update;
  update.cache_bytes = settings.editor_cache_bytes;
  UpdaterCoding coding(arena, update);
  MemoryCatalogue catalogue;
  NoMetrics metrics;
  const auto access = open_access();
  MAPCODEC_ASSIGN(const auto service, MapService::open(settings.service, coding, catalogue, metrics));
  for (const MapEntry& m : service->list()) {
    if (!m.fault.empty()) spdlog::error("map '{}' cannot be opened: {}", m.name, m.fault);
  }
  MAPCODEC_ASSIGN(const auto server, GrpcServer::start(settings.grpc, *service, *access, metrics));
  server->set_serving(true);
  for (const std::string& a : server->addresses()) spdlog::info("listening on {}", a);
  MAPCODEC_TRY(write_port_file(settings.port_file, server->addresses()));
  while (!stop) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  spdlog::info("draining");
  const auto drain = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * settings.drain_s));
  server->stop(std::chrono::system_clock::now() + drain);
  service->drain();
  spdlog::info("ended");
  return {};
}

}  // namespace mapcodec::daemon
