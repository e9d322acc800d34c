// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/verify.hpp"

#include <spdlog/fmt/fmt.h>

#include <memory>

#include "tools/verbs/bag_flags.hpp"
#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map;
  std::vector<std::string> originals;
  BagOptions bag;
  bool json = false;
  int threads = 0;
  std::string progress = "auto";
};

Json outcome_json(const VerifyOutcome& v) {
  Json j;
  j["ok"] = v.promise_kept;
  j["tiles"] = v.tiles;
  j["points"] = v.points;
  j["unfinished_bytes"] = v.trailing_bytes;
  j["findings"] = v.findings;
  if (v.evaluation) j["evaluation"] = evaluation_json(*v.evaluation, 0, 0);
  return j;
}

int run(const Arguments& a) {
  Arena arena(a.threads);
  ReadSettings settings;
  settings.arena = &arena;
  settings.progress = progress_printer(a.progress);
  settings.stop = stop_flag();
  const auto v = a.originals.empty() ? verify_map(a.map, settings)
                                     : verify_map_against(a.map, a.originals, settings, a.bag);
  settings.progress = {};
  if (!v.ok()) return fail(a.map, v.error());
  if (a.json) fmt::print("{}\n", outcome_json(*v).dump(2));
  if (!v->promise_kept) return fail(a.map, make_error(ErrorCode::kPromiseBroken, v->findings.front()));
  if (!a.json) {
    fmt::print("{}: sound, {} tiles, {} points{}\n", a.map, v->tiles, human_count(v->points),
               a.originals.empty() ? "" : ", promise kept");
    if (v->trailing_bytes > 0)
      fmt::print("{} of an unfinished update follow; the next writer drops them\n",
                 human_bytes(v->trailing_bytes));
    if (v->evaluation) print_evaluation(*v->evaluation);
  }
  return kDone;
}

}  // namespace

void add_verify(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      app.add_subcommand("verify", "Checksums and structure; with an original: the promise, measured");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option("--against", a->originals, "The original file or files")->expected(1, -1);
  add_bag_flags(*verb, a->bag);
  verb->add_flag("--json", a->json, "As JSON");
  verb->add_option("--threads", a->threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_option("--progress", a->progress, "auto, bar, plain, json or none, on stderr")
      ->check(CLI::IsMember({"auto", "bar", "plain", "json", "none"}));
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
