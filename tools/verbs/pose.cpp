// SPDX-License-Identifier: GPL-3.0-or-later
// pose: corrects where submaps lie. No tile is touched.
#include <spdlog/fmt/fmt.h>

#include <fstream>
#include <memory>
#include <sstream>

#include "maps/map_writer.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"
#include "tools/verbs/change.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/remote.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, submap, pose, file;
  bool json = false;
};

using NamedPoses = std::vector<std::pair<std::string, PoseChange>>;

/// Lines of a name and seven numbers.
Result<NamedPoses> read_poses(const std::string& path) {
  std::ifstream in(path);
  if (!in) return make_error(ErrorCode::kNotFound, path + ": cannot be read");
  NamedPoses poses;
  std::string line;
  for (int n = 1; std::getline(in, line); ++n) {
    std::istringstream words(line);
    std::string name, text, word;
    if (!(words >> name) || name[0] == '#') continue;
    while (words >> word) text += (text.empty() ? "" : ",") + word;
    auto pose = parse_pose(text);
    if (!pose.ok())
      return make_error(ErrorCode::kMalformed, fmt::format("{}: line {}: {}", path, n, pose.error().message));
    poses.emplace_back(name, std::move(pose).value());
  }
  return poses;
}

Result<std::vector<PoseChange>> numbered(const MapInfo& info, const NamedPoses& named) {
  std::vector<PoseChange> changes;
  for (const auto& [name, pose] : named) {
    PoseChange change = pose;
    while (change.submap < info.submaps.size() && info.submaps[change.submap].name != name) ++change.submap;
    if (change.submap == info.submaps.size())
      return make_error(ErrorCode::kNotFound, "no submap is called '" + shown(name) + "'");
    changes.push_back(change);
  }
  return changes;
}

Result<NamedPoses> asked(const Arguments& a) {
  if (!a.file.empty()) return read_poses(a.file);
  MAPCODEC_ASSIGN(const PoseChange pose, parse_pose(a.pose));
  return NamedPoses{{a.submap, pose}};
}

Result<std::uint64_t> change(const Arguments& a, const NamedPoses& named) {
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(a.map));
  MAPCODEC_ASSIGN(const std::vector<PoseChange> changes, numbered(writer.info(), named));
  MAPCODEC_TRY(check_octree_pose(writer.info(), changes));
  MAPCODEC_TRY(writer.set_poses(changes));
  return writer.commit(commit_time());
}

int run(const Arguments& a) {
  if (a.file.empty() && (a.submap.empty() || a.pose.empty())) {
    fail("pose", make_error(ErrorCode::kInvalidArgument, "give --submap and --pose, or --file"));
    return kUsage;
  }
  const auto named = asked(a);
  if (!named.ok()) {
    const int code = fail("pose", named.error());
    return a.file.empty() ? int(kUsage) : code;
  }
  const auto revision = is_remote(a.map) ? set_poses_remote(a.map, *named) : change(a, *named);
  if (!revision.ok()) return fail(a.map, revision.error());
  if (a.json) {
    fmt::print("{}\n", json_text(Json{{"revision", *revision}, {"poses", named->size()}}));
  } else {
    fmt::print("{}: revision {}, {} set\n", a.map, *revision,
               named->size() == 1 ? "1 pose" : human_count(named->size()) + " poses");
  }
  return kDone;
}

}  // namespace

void add_pose(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("pose", "Moves submaps, in one small revision; no tile is touched");
  verb->add_option("MAP", a->map, "The archive")->required();
  auto* file = verb->add_option("--file", a->file, "Lines of: submap x y z qx qy qz qw");
  verb->add_option("--submap", a->submap, "Its name")->excludes(file);
  verb->add_option("--pose", a->pose, "T_map_submap as x,y,z,qx,qy,qz,qw [m]")->excludes(file);
  verb->add_flag("--json", a->json, "Summary as JSON on stdout");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
