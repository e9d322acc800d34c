// SPDX-License-Identifier: GPL-3.0-or-later
// mapcodecd jobs | retention: what went on in the background, and how many revisions compaction keeps.
#include <spdlog/fmt/fmt.h>

#include <nlohmann/json.hpp>

#include "maps/service/catalogue.hpp"
#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/operations/command_line.hpp"
#include "tools/mapcodecd/operations/duration_text.hpp"

namespace mapcodec::daemon {
namespace {

using Json = nlohmann::ordered_json;

struct RetentionArguments {
  std::string map;
  std::uint64_t keep_last = 0;
};

const char* state_name(Job::State state) {
  switch (state) {
    case Job::State::running:
      return "running";
    case Job::State::done:
      return "done";
    case Job::State::failed:
      return "failed";
    case Job::State::interrupted:
      return "interrupted";
  }
  return "?";
}

void print_job(const Job& job, bool json) {
  if (json) {
    fmt::print("{}\n", Json({{"id", job.id},
                             {"map", job.map},
                             {"job", job.kind},
                             {"state", state_name(job.state)},
                             {"begun_s", job.begun_s},
                             {"ended_s", job.ended_s},
                             {"error", job.outcome}})
                           .dump(-1, ' ', false, Json::error_handler_t::replace));
  } else {
    fmt::print("{:>6} {:<20} {:<10} {:<12} {:<20} {}\n", job.id, job.map, job.kind, state_name(job.state),
               date_text(job.begun_s), job.outcome);
  }
}

int run_jobs(bool json, const DaemonSettings& settings) {
  const auto catalogue = Catalogue::open(catalogue_path(settings), settings.retention);
  if (!catalogue.ok()) return fail(catalogue.error());
  const auto jobs = (*catalogue)->jobs();
  if (!jobs.ok()) return fail(jobs.error());
  for (const Job& job : *jobs) print_job(job, json);
  return 0;
}

int run_retention(const RetentionArguments& a, const DaemonSettings& settings) {
  const auto catalogue = Catalogue::open(catalogue_path(settings), settings.retention);
  if (!catalogue.ok()) return fail(catalogue.error());
  if (a.keep_last > 0) {
    const Status set = (*catalogue)->set_retention(a.map, {a.keep_last});
    if (!set.ok()) return fail(set.error());
  }
  const auto kept = (*catalogue)->retention(a.map);
  if (!kept.ok()) return fail(kept.error());
  fmt::print("{}\n", kept->keep_last);
  return 0;
}

}  // namespace

void add_catalogue_verbs(CLI::App& app, CommandLine& line) {
  auto json = std::make_shared<bool>(false);
  CLI::App* jobs = app.add_subcommand("jobs", "Work in the background, the newest first")->fallthrough();
  jobs->add_flag("--json", *json, "One JSON object a line");
  jobs->callback(
      [json, &line] { line.verb = [json](const DaemonSettings& s) { return run_jobs(*json, s); }; });

  auto a = std::make_shared<RetentionArguments>();
  CLI::App* retention =
      app.add_subcommand("retention", "Revisions of a map that compaction keeps beside snapshots")
          ->fallthrough();
  retention->add_option("MAP", a->map, "Name of the map")->required();
  retention->add_option("--keep-last", a->keep_last, "Change it")->check(CLI::PositiveNumber);
  retention->callback(
      [a, &line] { line.verb = [a](const DaemonSettings& s) { return run_retention(*a, s); }; });
}

}  // namespace mapcodec::daemon
