// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <memory>

#include "maps/compaction.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, output;
  bool force = false, json = false;
};

Json lost_json(const LostTile& t) {
  Json j = tile_json(t.submap, t.key);
  j["revision"] = t.revision;
  j["points"] = t.points;
  j["reason"] = t.reason;
  j["saved_revision"] = t.saved_revision;
  return j;
}

Json report_json(const RepairReport& r) {
  Json j;
  j["saved_all"] = r.saved_all();
  j["revision"] = r.revision;
  j["tiles_saved"] = r.tiles_saved;
  j["points_saved"] = r.points_saved;
  j["points_lost"] = r.points_lost;
  j["bytes_before"] = r.bytes_before;
  j["bytes_after"] = r.bytes_after;
  j["corrected"] = r.corrected;
  j["notes"] = r.notes;
  j["lost"] = Json::array();
  for (const LostTile& t : r.lost) j["lost"].push_back(lost_json(t));
  return j;
}

void print(const Arguments& a, const RepairReport& r) {
  for (const std::string& note : r.corrected) fmt::print("corrected: {}\n", shown(note));
  for (const std::string& note : r.notes) fmt::print("lost: {}\n", shown(note));
  for (const LostTile& t : r.lost) {
    fmt::print("lost: {} of revision {}, {} points{}\n", tile_text(t.submap, t.key), t.revision,
               human_count(t.points),
               t.saved_revision > 0 ? fmt::format("; saved as in revision {}", t.saved_revision) : "");
  }
  fmt::print("{}: revision {}, {} tiles, {} points saved\n", a.output, r.revision, human_count(r.tiles_saved),
             human_count(r.points_saved));
}

int run(const Arguments& a) {
  const auto r = repair_archive(a.map, a.output, a.force);
  if (!r.ok()) return fail(r.error().code == ErrorCode::kCannotWrite ? a.output : a.map, r.error());
  if (a.json) {
    fmt::print("{}\n", json_text(report_json(*r)));
  } else {
    print(a, *r);
  }
  if (r->saved_all()) return kDone;
  const std::string lost = r->lost.empty() ? shown(r->notes.front())
                                           : fmt::format("{} tiles are lost, {} points of revision {}",
                                                         r->lost.size(), r->points_lost, r->revision);
  return fail(a.map, make_error(ErrorCode::kPromiseBroken, lost));
}

}  // namespace

void add_repair(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      app.add_subcommand("repair", "Saves what is whole of a damaged archive; says what is lost");
  verb->add_option("MAP", a->map, "The damaged archive; never written to")->required();
  verb->add_option("-o,--output", a->output, "The new archive")->required();
  verb->add_flag("--force", a->force, "Replace an existing file");
  verb->add_flag("--json", a->json, "As JSON");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
