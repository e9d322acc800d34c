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
  std::string map, name;
  bool remove = false, json = false;
};

struct Named {
  std::uint64_t named = 0, revision = 0;  ///< what bears the name; the commit that says so
};

Result<Named> change(const Arguments& a) {
  Named r;
  if (is_remote(a.map)) {
    MAPCODEC_ASSIGN(r.named, snapshot_remote(a.map, a.name, a.remove));
    r.revision = a.remove ? r.named : r.named + 1;
    return r;
  }
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(a.map));
  r.named = writer.revision();
  MAPCODEC_TRY(a.remove ? writer.remove_snapshot(a.name) : writer.add_snapshot(a.name));
  MAPCODEC_ASSIGN(r.revision, writer.commit(commit_time()));
  return r;
}

int run(const Arguments& a) {
  const auto changed = change(a);
  if (!changed.ok()) return fail(a.map, changed.error());
  const auto& [named, revision] = *changed;
  if (a.json) {
    Json j{{"name", a.name}, {"removed", a.remove}, {"revision", revision}};
    if (!a.remove) j["snapshot_revision"] = named;
    fmt::print("{}\n", json_text(j));
  } else if (a.remove) {
    fmt::print("{}: no snapshot '{}' any more (revision {})\n", a.map, shown(a.name), revision);
  } else {
    fmt::print("{}: snapshot '{}' is revision {} (named in revision {})\n", a.map, shown(a.name), named,
               revision);
  }
  return kDone;
}

}  // namespace

void add_snapshot(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("snapshot", "Names the current revision: compaction keeps it");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option("NAME", a->name, "Of the snapshot; not digits only")->required();
  verb->add_flag("--remove", a->remove, "Forget the name");
  verb->add_flag("--json", a->json, "As JSON");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
