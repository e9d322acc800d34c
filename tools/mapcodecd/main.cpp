// SPDX-License-Identifier: GPL-3.0-or-later
// mapcodecd: serves a folder of maps. In the foreground, logs to stderr, ends on SIGTERM.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>

#include "tools/mapcodecd/daemon.hpp"
#include "tools/version.hpp"

namespace {

std::atomic<bool> stop_requested{false};

void request_stop(int signal) {
  stop_requested.store(true);
  // A second signal ends the program at once.
  std::signal(signal, SIG_DFL);
}

int exit_code(mapcodec::ErrorCode code) {
  switch (code) {
    case mapcodec::ErrorCode::kInvalidArgument:
      return 2;
    case mapcodec::ErrorCode::kCannotWrite:
      return 4;
    default:
      return 3;
  }
}

}  // namespace

int main(int argc, char** argv) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("mapcodecd"));
  CLI::App app{"mapcodecd: a folder of maps, served over the network"};
  app.set_version_flag("--version", std::string("mapcodecd ") + mapcodec::kVersion);
  mapcodec::daemon::DaemonSettings settings;
  app.add_option("--data", settings.service.folder, "Folder of the archives")->required();
  app.add_option("--listen", settings.grpc.listen, "HOST:PORT, [HOST]:PORT or unix:/PATH; may be repeated");
  app.add_option("--port-file", settings.port_file, "Where the bound addresses are written");
  app.add_flag("--insecure", settings.grpc.insecure, "Plain text also beyond this machine");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    std::fprintf(stderr, "mapcodecd: %s (see mapcodecd --help)\n", e.what());
    return 2;
  }
  std::signal(SIGTERM, request_stop);
  std::signal(SIGINT, request_stop);
  // A client that goes away, or a file size limit, is an error of a call and not a death.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  const mapcodec::Status s = mapcodec::daemon::run(settings, stop_requested);
  if (s.ok()) return 0;
  std::fprintf(stderr, "mapcodecd: %s\n", s.error().to_string().c_str());
  return exit_code(s.error().code);
}
