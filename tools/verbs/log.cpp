// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <memory>

#include "tools/verbs/history.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map;
  bool json = false;
};

Json revision_json(const RevisionInfo& r, const MapInfo& info) {
  Json j;
  j["revision"] = r.revision;
  j["timestamp_s"] = r.timestamp_s;
  j["tiles"] = r.tiles;
  j["bytes"] = r.bytes;
  j["snapshots"] = Json::array();
  for (const Snapshot& s : info.snapshots) {
    if (s.revision == r.revision) j["snapshots"].push_back(s.name);
  }
  return j;
}

void print_table(const std::vector<RevisionInfo>& log, const MapInfo& info) {
  fmt::print("{:>10} {:>20} {:>10} {:>11}  {}\n", "revision", "time (UTC)", "tiles", "written", "snapshot");
  for (const RevisionInfo& r : log) {
    const std::string line =
        fmt::format("{:>10} {:>20} {:>10} {:>11}  {}", r.revision, time_text(r.timestamp_s),
                    human_count(r.tiles), human_bytes(r.bytes), shown(names_of(info, r.revision), 22));
    fmt::print("{}\n", line.substr(0, line.find_last_not_of(' ') + 1));
  }
}

int run(const Arguments& a) {
  const auto archive = MapArchive::open(a.map);
  if (!archive.ok()) return fail(a.map, archive.error());
  const auto log = archive->log();
  if (!log.ok()) return fail(a.map, log.error());
  if (a.json) {
    Json j;
    j["revision"] = archive->revision();
    j["bytes"] = archive->file_bytes();
    for (const RevisionInfo& r : *log) j["revisions"].push_back(revision_json(r, archive->info()));
    fmt::print("{}\n", json_text(j));
  } else {
    print_table(*log, archive->info());
  }
  if (!archive->lost_newest()) return kDone;
  return fail(a.map, make_error(ErrorCode::kArchiveDamaged,
                                fmt::format("a revision after revision {} is damaged", archive->revision()),
                                archive->file_bytes()));
}

}  // namespace

void add_log(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("log", "The revisions of an archive, the newest first");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_flag("--json", a->json, "As JSON");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
