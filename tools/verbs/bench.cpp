// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/bench.hpp"

#include <spdlog/fmt/fmt.h>

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

int run(Arguments& a) {
  a.settings.say = [](const std::string& text) { fmt::print(stderr, "{}\n", text); };
  a.settings.print = [](const std::string& text) { fmt::print("{}\n", text); };
  const Status s = a.what == "paper"     ? bench_paper(a.settings)
                   : a.what == "formats" ? bench_formats(a.settings)
                   : a.what == "local"   ? bench_local(a.settings)
                   : a.what == "octomap" ? bench_octomap(a.settings)
                   : a.what == "scaling" ? bench_scaling(a.settings)
                   : a.what == "seams"   ? bench_seams(a.settings)
                   : a.what == "surface" ? bench_surface(a.settings)
                   : a.what == "update"  ? bench_update(a.settings)
                   : a.what == "service" ? bench_service(a.settings)
                                         : bench_rate(a.settings);
  if (!s.ok()) return fail(a.settings.data, s.error());
  fmt::print("{}/{}.md\n", a.settings.report, a.what);
  return kDone;
}

}  // namespace

void add_bench(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("bench", "Measurements on a folder of clouds: JSON, tables and plots");
  verb->add_option("WHAT", a->what,
                   "formats, local, octomap, paper, rate, scaling, seams, service, surface or update")
      ->required()
      ->check(CLI::IsMember({"formats", "local", "octomap", "paper", "rate", "scaling", "seams", "service",
                             "surface", "update"}));
  verb->add_option("--data", a->settings.data, "Folder that is searched for clouds")->required();
  verb->add_option("-o,--output", a->settings.report, "Folder for the report")->required();
  verb->add_option("--threads", a->settings.threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_option("--only", a->settings.files, "Only clouds whose path contains one of these");
  verb->add_option("--minutes", a->settings.minutes, "service: of the mixed load")->check(CLI::PositiveNumber);
  verb->add_flag("--quick", a->settings.quick, "Few clouds and bounds");
  verb->add_flag("--goals", a->settings.goals_alone, "surface: only the figures that it is built for");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
