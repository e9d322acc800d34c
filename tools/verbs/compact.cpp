// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/compaction.hpp"

#include <spdlog/fmt/fmt.h>

#include <memory>

#include "slam_adapter/map_updater.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/remote.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, hashes = "keep";
  std::uint64_t keep_last = 1;
  int threads = 0;
  bool json = false;
};

CompactSettings settings_of(const Arguments& a) {
  CompactSettings settings;
  settings.keep_last = a.keep_last;
  if (a.hashes != "keep") settings.hashes = a.hashes == "on";
  settings.stop = [stop = stop_flag()] { return stop->load(); };
  return settings;
}

Json report_json(const CompactReport& r) {
  Json j;
  j["bytes_before"] = r.bytes_before;
  j["bytes_after"] = r.bytes_after;
  j["revisions_before"] = r.revisions_before;
  j["revisions_after"] = r.revisions_after;
  j["segments_before"] = r.segments_before;
  j["segments_after"] = r.segments_after;
  j["folded_tiles"] = r.folded_tiles;
  j["tiles"] = r.tiles;
  j["hashes"] = r.hashes;
  return j;
}

/// What updates left pending becomes part of its tiles, in a revision of its own where there is any.
Result<std::uint64_t> fold_pending(const Arguments& a) {
  Arena arena(a.threads);
  UpdateSettings settings;
  settings.stop = stop_flag();
  MAPCODEC_ASSIGN(MapUpdater map, MapUpdater::open(a.map, arena, settings));
  MAPCODEC_TRY(map.fold());
  MAPCODEC_ASSIGN(const UpdateReport report, map.commit(commit_time()));
  return report.tiles_folded;
}

int run(const Arguments& a) {
  const auto folded = is_remote(a.map) ? Result<std::uint64_t>(0) : fold_pending(a);
  // A map by the paper's method has nothing to fold.
  if (!folded.ok() && folded.error().code != ErrorCode::kUnsupported) return fail(a.map, folded.error());
  auto r = is_remote(a.map) ? compact_remote(a.map, a.keep_last) : compact_archive(a.map, settings_of(a));
  if (!r.ok()) return fail(a.map, r.error());
  r->folded_tiles += folded.ok() ? *folded : 0;
  if (a.json) {
    fmt::print("{}\n", json_text(report_json(*r)));
  } else {
    fmt::print("{}: {} -> {}, {} of {} revisions kept, {} tiles, {} folded\n", a.map,
               human_bytes(r->bytes_before), human_bytes(r->bytes_after), r->revisions_after,
               r->revisions_before, human_count(r->tiles), human_count(r->folded_tiles));
  }
  return kDone;
}

}  // namespace

void add_compact(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      app.add_subcommand("compact", "Rewrites an archive without the revisions that nothing names");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option("--keep", a->keep_last, "Newest revisions that stay beside the snapshots")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 32));
  verb->add_option("--hashes", a->hashes, "Store content hashes of the tiles: on, off or keep (as it is)")
      ->check(CLI::IsMember({"on", "off", "keep"}));
  verb->add_option("--threads", a->threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_flag("--json", a->json, "As JSON");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
