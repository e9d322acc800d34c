// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <memory>

#include "maps/map_writer.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/remote.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, revision;
  bool json = false;
};

struct Restored {
  std::uint64_t from = 0, revision = 0, tiles = 0;
};

Result<Restored> roll_back_remote(const Arguments& a) {
  Restored r;
  MAPCODEC_ASSIGN(r.from, resolve_revision(a.map, a.revision));
  MAPCODEC_ASSIGN(r.revision, rollback_remote(a.map, a.revision));
  MAPCODEC_ASSIGN(const MapArchive archive, MapArchive::open(a.map, r.revision));
  r.tiles = archive.tiles().size();
  return r;
}

Result<Restored> roll_back(const Arguments& a) {
  if (is_remote(a.map)) return roll_back_remote(a);
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(a.map));  // first: from here on nobody else changes it
  Restored r;
  {
    MAPCODEC_ASSIGN(const MapArchive archive, MapArchive::open(a.map));
    MAPCODEC_ASSIGN(r.from, archive.resolve(a.revision));
  }
  MAPCODEC_TRY(writer.restore(r.from));
  r.tiles = writer.tile_count();
  MAPCODEC_ASSIGN(r.revision, writer.commit(commit_time()));
  return r;
}

int run(const Arguments& a) {
  const auto r = roll_back(a);
  if (!r.ok()) return fail(a.map, r.error());
  if (a.json) {
    fmt::print("{}\n", json_text({{"revision", r->revision}, {"restored", r->from}, {"tiles", r->tiles}}));
  } else {
    fmt::print("{}: revision {} is what revision {} was, {} tiles\n", a.map, r->revision, r->from,
               human_count(r->tiles));
  }
  return kDone;
}

}  // namespace

void add_rollback(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("rollback", "A new revision that is what an older one was");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option("REV", a->revision, "Number or snapshot")->required();
  verb->add_flag("--json", a->json, "As JSON");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
