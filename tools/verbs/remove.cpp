// SPDX-License-Identifier: GPL-3.0-or-later
// remove, crop: points go by place, by submap, or by the values of a channel.
#include <chrono>
#include <memory>

#include "slam_adapter/map_updater.hpp"
#include "tools/verbs/change.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/remote.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, box, sphere, submap, where;
  int threads = 0;
  bool json = false, crop = false;
};

/// "channel:least:most".
Result<Erasure::Values> parse_values(const std::string& text) {
  const auto second = text.rfind(':');
  const auto first =
      second == std::string::npos || second == 0 ? std::string::npos : text.rfind(':', second - 1);
  if (first == std::string::npos || first == 0)
    return make_error(ErrorCode::kInvalidArgument, "--where wants channel:least:most");
  MAPCODEC_ASSIGN(const std::vector<double> least,
                  parse_numbers(text.substr(first + 1, second - first - 1), 1));
  MAPCODEC_ASSIGN(const std::vector<double> most, parse_numbers(text.substr(second + 1), 1));
  return Erasure::Values{text.substr(0, first), least[0], most[0]};
}

Result<std::optional<Erasure>> erasure_of(const Arguments& a) {
  Erasure e;
  e.inverse = a.crop;
  if (!a.box.empty()) {
    MAPCODEC_ASSIGN(e.box, parse_box(a.box));
  }
  if (!a.sphere.empty()) {
    MAPCODEC_ASSIGN(const Region::Sphere s, parse_sphere(a.sphere));
    e.sphere = Erasure::Sphere{s.centre, s.radius_m};
  }
  if (!a.where.empty()) {
    MAPCODEC_ASSIGN(e.values, parse_values(a.where));
  }
  if (!e.box && !e.sphere && !e.values) return std::optional<Erasure>{};
  return std::optional<Erasure>{e};
}

Result<std::optional<std::uint32_t>> submap_number(const MapInfo& info, const std::string& name) {
  if (name.empty()) return std::optional<std::uint32_t>{};
  for (std::uint32_t i = 0; i < info.submaps.size(); ++i) {
    if (info.submaps[i].name == name) return std::optional<std::uint32_t>{i};
  }
  return make_error(ErrorCode::kNotFound, "no submap is called '" + name + "'");
}

Result<UpdateReport> change(const Arguments& a, const std::optional<Erasure>& e) {
  Arena arena(a.threads);
  UpdateSettings settings;
  settings.stop = stop_flag();
  MAPCODEC_ASSIGN(MapUpdater map, MapUpdater::open(a.map, arena, settings));
  MAPCODEC_ASSIGN(const std::optional<std::uint32_t> submap, submap_number(map.info(), a.submap));
  MAPCODEC_TRY(map.erase(e, submap));
  return map.commit(commit_time());
}

int run(const Arguments& a) {
  const auto e = erasure_of(a);
  if (!e.ok()) {
    fail(a.crop ? "crop" : "remove", e.error());
    return kUsage;
  }
  if (!*e && a.submap.empty()) {
    fail("remove", make_error(ErrorCode::kInvalidArgument, "say what: --box, --sphere, --where or --submap"));
    return kUsage;
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto report = is_remote(a.map) ? erase_remote(a.map, *e, a.submap) : change(a, *e);
  if (!report.ok()) return fail(a.map, report.error());
  print_change(a.map, *report, {},
               std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), a.json);
  return kDone;
}

void add_places(CLI::App& verb, Arguments& a) {
  verb.add_option("--box", a.box, "x0,y0,z0,x1,y1,z1 [m, map frame]");
  verb.add_option("--sphere", a.sphere, "x,y,z,r [m, map frame]");
  verb.add_option("--threads", a.threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb.add_flag("--json", a.json, "Summary as JSON on stdout");
}

}  // namespace

void add_remove(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("remove", "Removes points: those for which all that is given holds");
  verb->add_option("MAP", a->map, "The archive")->required();
  add_places(*verb, *a);
  verb->add_option("--submap", a->submap, "Of this submap only");
  verb->add_option("--where", a->where, "channel:least:most, such as intensity:0:3 or label:7:7");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

void add_crop(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  a->crop = true;
  CLI::App* verb = app.add_subcommand("crop", "Removes all points but those inside");
  verb->add_option("MAP", a->map, "The archive")->required();
  add_places(*verb, *a);
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
