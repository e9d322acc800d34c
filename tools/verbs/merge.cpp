// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <memory>

#include "slam_adapter/update.hpp"
#include "tools/verbs/change.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/remote.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map;
  MergeRequest request;
  int threads = 0;
  bool json = false;
};

int run(Arguments& a) {
  const auto begin = std::chrono::steady_clock::now();
  Arena arena(a.threads);
  a.request.settings.stop = stop_flag();
  a.request.timestamp_s = commit_time();
  std::vector<std::string> warnings;
  const auto report = is_remote(a.map) ? merge_remote(a.map, a.request, warnings)
                                       : merge_maps(a.map, a.request, arena, warnings);
  if (!report.ok()) return fail(a.map, report.error());
  print_change(a.map, *report, warnings,
               std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), a.json);
  return kDone;
}

}  // namespace

void add_merge(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("merge", "Adds other archives to a map, as one revision");
  verb->add_option("MAP", a->map, "The archive that grows")->required();
  verb->add_option("OTHER", a->request.others, "Archives, of any tile size; they are only read")->required();
  verb->add_flag("--fuse", a->request.fuse, "Submaps of OTHER become points of the map instead of submaps");
  verb->add_option("--threads", a->threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_flag("--json", a->json, "Summary as JSON on stdout");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
