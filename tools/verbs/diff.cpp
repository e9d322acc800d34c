// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <array>
#include <memory>

#include "maps/map_changes.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, from, to;
  bool json = false, hashes = false;
};

struct Difference {
  std::uint64_t from = 0, to = 0;
  std::vector<TileChange> changes;
  std::array<std::uint64_t, 3> counts{};  // by kind
  std::uint64_t bytes = 0;                // of what was added or changed
};

constexpr const char* kKinds[] = {"added", "changed", "removed"};

Result<Difference> compare(const Arguments& a) {
  MAPCODEC_ASSIGN(const MapArchive newest, MapArchive::open(a.map));
  Difference d;
  MAPCODEC_ASSIGN(d.from, newest.resolve(a.from));
  MAPCODEC_ASSIGN(d.to, newest.resolve(a.to));
  MAPCODEC_ASSIGN(const MapArchive from, newest.at(d.from));
  MAPCODEC_ASSIGN(const MapArchive to, newest.at(d.to));
  MAPCODEC_ASSIGN(d.changes, diff_maps(from, to, a.hashes));
  for (const TileChange& c : d.changes) {
    ++d.counts[static_cast<std::size_t>(c.kind)];
    d.bytes += c.bytes_after;
  }
  return d;
}

Json change_json(const TileChange& c, bool hashes) {
  Json j = tile_json(c.submap, c.key);
  j["change"] = kKinds[static_cast<std::size_t>(c.kind)];
  j["points"] = {c.points_before, c.points_after};
  j["bytes"] = {c.bytes_before, c.bytes_after};
  if (hashes && c.tile) j["hash"] = c.hash.to_string();
  return j;
}

Json difference_json(const Difference& d, bool hashes) {
  Json j;
  j["from"] = d.from;
  j["to"] = d.to;
  for (std::size_t k = 0; k < 3; ++k) j[kKinds[k]] = d.counts[k];
  j["bytes"] = d.bytes;
  j["tiles"] = Json::array();
  for (const TileChange& c : d.changes) j["tiles"].push_back(change_json(c, hashes));
  return j;
}

void print(const Difference& d, bool hashes) {
  for (const TileChange& c : d.changes) {
    fmt::print("{} {:<26} {:>12} {:>12} points {:>12}\n", "+~-"[static_cast<std::size_t>(c.kind)],
               tile_text(c.submap, c.key), human_count(c.points_before), "-> " + human_count(c.points_after),
               human_bytes(c.bytes_after));
    if (hashes && c.tile) fmt::print("  {}\n", c.hash.to_string());
  }
  fmt::print("revision {} to {}: {} added, {} changed, {} removed, {}\n", d.from, d.to, d.counts[0],
             d.counts[1], d.counts[2], human_bytes(d.bytes));
}

int run(const Arguments& a) {
  const auto d = compare(a);
  if (!d.ok()) return fail(a.map, d.error());
  if (a.json) {
    fmt::print("{}\n", json_text(difference_json(*d, a.hashes)));
  } else {
    print(*d, a.hashes);
  }
  return kDone;
}

}  // namespace

void add_diff(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("diff", "Tiles that were added (+), changed (~), removed (-)");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option("REV1", a->from, "Number or snapshot")->required();
  verb->add_option("REV2", a->to, "Number or snapshot")->required();
  verb->add_flag("--hashes", a->hashes, "With the content hash of each tile");
  verb->add_flag("--json", a->json, "As JSON");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
