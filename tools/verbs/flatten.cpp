// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <memory>

#include "slam_adapter/map_source.hpp"
#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, output, progress = "auto";
  CompressOptions options;
  bool json = false;
};

int run(Arguments& a) {
  if (!a.options.overwrite && path_exists(a.output))
    return fail(a.output, make_error(ErrorCode::kCannotWrite, "exists already (--force replaces it)"));
  a.options.stop = stop_flag();
  a.options.progress = progress_printer(a.progress);
  const auto report = flatten_map(a.map, a.output, a.options);
  a.options.progress = {};
  if (!report.ok())
    return fail(report.error().code == ErrorCode::kCannotWrite ? a.output : a.map, report.error());
  for (const std::string& warning : report->warnings) spdlog::warn("note: {}", warning);
  const auto map = MapFile::open(a.output);
  if (!map.ok()) return fail(a.output, map.error());
  if (a.json) {
    fmt::print("{}\n", info_json(*map).dump(2));
  } else {
    print_info(*map);
  }
  return kDone;
}

}  // namespace

void add_flatten(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand(
      "flatten", "A new archive with all submaps as one; its errors come on top of those the map has");
  verb->add_option("MAP", a->map, "The archive; it is only read")->required();
  verb->add_option("-o,--output", a->output, "The new archive")->required();
  verb->add_option("--tile-size", a->options.tile_size_m, "Side of a tile [m]")->check(CLI::PositiveNumber);
  verb->add_option("--threads", a->options.threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_option("--progress", a->progress, "auto, bar, plain, json or none, on stderr")
      ->check(CLI::IsMember({"auto", "bar", "plain", "json", "none"}));
  verb->add_flag("--json", a->json, "Summary as JSON on stdout");
  verb->add_flag("--force", a->options.overwrite, "Replace an existing output");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
