// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/bench.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <memory>

#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string what;
  BenchSettings settings;
};

#ifndef MAPCODEC_SERVICE
Status bench_service(const BenchSettings&) {
  return make_error(ErrorCode::kUnsupported, "this mapcodec was built without the service");
}
#endif

/// What cutting a map into tiles costs, and how fast one tile comes.
Status bench_tiles(const BenchSettings& settings) {
  MAPCODEC_TRY(bench_seams(settings));
  BenchSettings tiles = settings;
  tiles.files = {"tiles"};
  return bench_local(tiles);
}

struct Bench {
  const char* name;
  Status (*run)(const BenchSettings&);
  std::vector<std::string> reports;  ///< besides its own name
};
const std::vector<Bench> kBenches{{"formats", bench_formats, {}},
                                  {"local", bench_local, {}},
                                  {"mrpt", bench_mrpt, {}},
                                  {"octomap", bench_octomap, {}},
                                  {"paper", bench_paper, {}},
                                  {"rate", bench_rate, {}},
                                  {"scaling", bench_scaling, {}},
                                  {"seams", bench_seams, {}},
                                  {"service", bench_service, {}},
                                  {"surface", bench_surface, {}},
                                  {"tiles", bench_tiles, {"seams", "local"}},
                                  {"update", bench_update, {}}};

std::vector<std::string> bench_names() {
  std::vector<std::string> names;
  for (const Bench& b : kBenches) names.emplace_back(b.name);
  return names;
}

int run(Arguments& a) {
  a.settings.say = [](const std::string& text) { fmt::print(stderr, "{}\n", text); };
  a.settings.print = [](const std::string& text) { fmt::print("{}\n", text); };
  const auto bench =
      std::find_if(kBenches.begin(), kBenches.end(), [&](const Bench& b) { return a.what == b.name; });
  if (const Status s = bench->run(a.settings); !s.ok()) return fail(a.settings.data, s.error());
  for (const std::string& report : bench->reports.empty() ? std::vector{a.what} : bench->reports)
    fmt::print("{}/{}.md\n", a.settings.report, report);
  return kDone;
}

}  // namespace

void add_bench(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("bench", "Measurements on a folder of clouds: JSON, tables and plots");
  verb->add_option("WHAT", a->what, "What is measured")->required()->check(CLI::IsMember(bench_names()));
  verb->add_option("--data", a->settings.data, "Folder that is searched for clouds")->required();
  verb->add_option("-o,--output", a->settings.report, "Folder for the report")->required();
  verb->add_option("--threads", a->settings.threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_option(
      "--only", a->settings.files,
      "Only clouds whose path contains one of these, or parts of a bench (service: fetch, sync, load, soak)");
  verb->add_option("--minutes", a->settings.minutes, "service: of the mixed load")
      ->check(CLI::PositiveNumber);
  verb->add_flag("--quick", a->settings.quick, "Few clouds and bounds");
  verb->add_flag("--goals", a->settings.goals_alone, "surface: only the figures that it is built for");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
