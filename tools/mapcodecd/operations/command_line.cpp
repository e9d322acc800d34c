// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/operations/command_line.hpp"

#include <cstdio>

#include "tools/mapcodecd/config/config.hpp"

namespace mapcodec::daemon {

void add_options(CLI::App& app, CommandLine& line) {
  app.add_option("--config", line.config_file, "Configuration file (TOML); see --print-config");
  app.add_option("--data", line.folder, "Folder of the archives");
  app.add_option("--listen", line.listen,
                 "gRPC: HOST:PORT, [HOST]:PORT or unix:/PATH; may be repeated. Replaces all addresses of the "
                 "configuration, those of HTTP too");
  app.add_option("--http", line.http, "HTTP: the same; may be repeated");
  app.add_option("--port-file", line.port_file, "Where the bound addresses are written");
  app.add_option("--log-level", line.log_level, "trace, debug, info, warn, error or off");
  app.add_flag("--log-json", line.log_json, "Log one JSON object a line");
  app.add_flag("--insecure", line.insecure, "Plain text also beyond this machine");
  app.add_flag("--print-config", line.print_config, "Print all settings as a configuration file, and end");
  app.add_flag("--check-config", line.check_config, "Say what is wrong with the settings, and end");
}

Result<DaemonSettings> settings_of(const CommandLine& line) {
  DaemonSettings settings;
  if (!line.config_file.empty()) {
    auto read = read_config(line.config_file);
    if (!read.ok()) return make_error(read.error().code, line.config_file + ": " + read.error().message);
    settings = std::move(read).value();
  }
  if (line.folder) settings.service.folder = *line.folder;
  if (line.port_file) settings.port_file = *line.port_file;
  if (line.log_level) settings.log.level = *line.log_level;
  if (line.listen) {
    settings.grpc.listen = *line.listen;
    settings.http.listen.clear();
  }
  if (line.http) settings.http.listen = *line.http;
  settings.log.json = settings.log.json || line.log_json;
  settings.grpc.insecure = settings.http.insecure = settings.grpc.insecure || line.insecure;
  return settings;
}

int fail(const Error& error) {
  std::fprintf(stderr, "mapcodecd: %s\n", error.to_string().c_str());
  switch (error.code) {
    case ErrorCode::kInvalidArgument:
    case ErrorCode::kExists:
      return 2;
    case ErrorCode::kCannotWrite:
      return 4;
    default:
      return 3;
  }
}

int report_check(const DaemonSettings& settings) {
  const std::vector<std::string> findings = check_config(settings);
  for (const std::string& finding : findings) std::fprintf(stderr, "mapcodecd: %s\n", finding.c_str());
  return findings.empty() ? 0 : 2;
}

}  // namespace mapcodec::daemon
