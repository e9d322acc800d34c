// SPDX-License-Identifier: GPL-3.0-or-later
// mapcodec: the command line. Each verb has its file in verbs/.
#include <malloc.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "tools/verbs/remote.hpp"
#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"
#include "tools/version.hpp"

namespace {

using namespace mapcodec::cli;

void log_to_stderr() {
  spdlog::set_default_logger(spdlog::stderr_color_st("mapcodec"));
  spdlog::set_pattern("mapcodec: %v");
}

/// Tile after tile asks for the same memory: giving it back in between costs a tenth of an encoder's time in
/// page faults. A failure changes nothing but that.
void keep_freed_memory() {
  constexpr int kLargestKept = 32 << 20, kFreeBeforeTrim = 256 << 20;
  mallopt(M_MMAP_THRESHOLD, kLargestKept);
  mallopt(M_TRIM_THRESHOLD, kFreeBeforeTrim);
}

/// A wrong command line is one line on stderr, like every failure; help and version go to stdout.
int end_of_parsing(const CLI::App& app, const CLI::ParseError& e) {
  if (e.get_exit_code() == 0) return app.exit(e);
  std::fprintf(stderr, "mapcodec: %s (see mapcodec --help)\n", e.what());
  return kUsage;
}

}  // namespace

int main(int argc, char** argv) {
  keep_freed_memory();
  log_to_stderr();
  CLI::App app{"mapcodec: compresses 3-D maps into tiled archives, and proves what it promised"};
  app.set_version_flag("--version", std::string("mapcodec ") + mapcodec::kVersion);
  app.require_subcommand(1);
  Action action;
  add_compress(app, action);
  add_decompress(app, action);
  add_info(app, action);
  add_verify(app, action);
  add_evaluate(app, action);
  add_render(app, action);
  add_bench(app, action);
  add_log(app, action);
  add_snapshot(app, action);
  add_diff(app, action);
  add_rollback(app, action);
  add_compact(app, action);
  add_repair(app, action);
  add_update(app, action);
  add_remove(app, action);
  add_crop(app, action);
  add_pose(app, action);
  add_merge(app, action);
  add_flatten(app, action);
  add_rawlog(app, action);
#ifdef MAPCODEC_SERVICE
  add_sync(app, action);
#endif
  use_services();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return end_of_parsing(app, e);
  }
  try {
    return action();
  } catch (const std::bad_alloc&) {
    return fail("", mapcodec::make_error(mapcodec::ErrorCode::kLimitExceeded, "out of memory"));
  } catch (const std::exception& e) {
    return fail("", mapcodec::make_error(mapcodec::ErrorCode::kMalformed, e.what()));
  }
}
