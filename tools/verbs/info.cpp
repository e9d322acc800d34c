// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <memory>

#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map;
  bool json = false, tiles = false;
};

void print_tiles(const MapFile& map) {
  fmt::print("\n{:>22} {:>9} {:>9} {:>10} {:>10} {:>10}\n", "tile (level: x,y,z)", "codec", "points", "bytes",
             "bits/pt", "RMS");
  for (const TileRecord& t : map.archive().tiles()) {
    std::uint64_t bytes = 0;
    for (const SegmentRef& s : t.segments) bytes += s.length;
    const std::string key = t.key.is_unplaced()
                                ? std::string("unplaced")
                                : fmt::format("{}: {},{},{}", t.key.level, t.key.x, t.key.y, t.key.z);
    fmt::print("{:>22} {:>9} {:>9} {:>10} {:>10.3f} {:>10}\n", key, codec_name(static_cast<CodecId>(t.codec)),
               t.points, bytes, 8.0 * double(bytes) / double(t.points), human_length(t.errors.rms_m));
  }
}

int run(const Arguments& a) {
  const auto map = MapFile::open(a.map);
  if (!map.ok()) return fail(a.map, map.error());
  if (a.json) {
    Json j = info_json(*map);
    if (a.tiles) j["tile_list"] = tiles_json(*map);
    fmt::print("{}\n", j.dump(2));
    return kDone;
  }
  print_info(*map);
  if (a.tiles) print_tiles(*map);
  return kDone;
}

}  // namespace

void add_info(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("info", "What an archive holds and what it promises");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_flag("--json", a->json, "As JSON");
  verb->add_flag("--tiles", a->tiles, "Each tile too");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
