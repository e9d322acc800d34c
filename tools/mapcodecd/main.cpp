// SPDX-License-Identifier: GPL-3.0-or-later
// mapcodecd: serves a folder of maps. In the foreground, logs to stderr, ends on SIGTERM.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>

#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/daemon.hpp"
#include "tools/mapcodecd/operations/command_line.hpp"
#include "tools/mapcodecd/operations/logging.hpp"
#include "tools/version.hpp"

namespace {

using namespace mapcodec::daemon;

std::atomic<bool> stop_requested{false};

void request_stop(int signal) {
  stop_requested.store(true);
  // A second signal ends the program at once.
  std::signal(signal, SIG_DFL);
}

int parse(CLI::App& app, int argc, char** argv, CommandLine& line) {
  app.set_version_flag("--version", std::string("mapcodecd ") + mapcodec::kVersion);
  app.require_subcommand(0, 1);
  add_options(app, line);
  add_token_verbs(app, line);
  add_catalogue_verbs(app, line);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    std::fprintf(stderr, "mapcodecd: %s (see mapcodecd --help)\n", e.what());
    return 2;
  }
  return -1;
}

int serve(const DaemonSettings& settings) {
  const mapcodec::Status logging = start_logging(settings.log);
  if (!logging.ok()) return fail(logging.error());
  std::signal(SIGTERM, request_stop);
  std::signal(SIGINT, request_stop);
  // A client that goes away, or a file size limit, is an error of a call and not a death.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  const mapcodec::Status s = run(settings, stop_requested);
  return s.ok() ? 0 : fail(s.error());
}

}  // namespace

namespace {

/// glibc keeps for each thread what it freed, and learns to keep larger and larger blocks: what one large
/// commit needed once would stay with a service that runs for months.
void give_memory_back() {
  ::mallopt(M_ARENA_MAX, 4);
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"mapcodecd: a folder of maps, served over the network"};
  CommandLine line;
  if (const int ended = parse(app, argc, argv, line); ended >= 0) return ended;
  try {
    const auto settings = settings_of(line);
    if (!settings.ok()) return fail(settings.error());
    if (line.print_config) return std::fputs(print_config(*settings).c_str(), stdout) < 0 ? 4 : 0;
    if (line.check_config) return report_check(*settings);
    if (settings->service.folder.empty()) {
      return fail(make_error(mapcodec::ErrorCode::kInvalidArgument,
                             "--data is needed, or storage.folder in --config"));
    }
    give_memory_back();
    return line.verb ? line.verb(*settings) : serve(*settings);
  } catch (const std::exception& e) {
    return fail(make_error(mapcodec::ErrorCode::kLimitExceeded, e.what()));
  }
}
