// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/octomap/octree_jobs.hpp"

#include <algorithm>
#include <chrono>

#include "mapcodec/cloud/occupancy_edit.hpp"

namespace mapcodec {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

Error with_file(const std::string& path, const Error& e) {
  if (e.message.find(path) != std::string::npos) return e;
  return make_error(e.code, path + ": " + e.message, e.offset);
}

Status lay_over(OctreeFile& all, const OctreeFile& next, const std::string& path) {
  if (next.resolution_m != all.resolution_m)
    return make_error(ErrorCode::kInvalidArgument, path + ": its resolution differs from the first octree's");
  if (next.tree.kind != all.tree.kind)
    return make_error(ErrorCode::kInvalidArgument,
                      path + ": its leaves are " + occupancy_name(next.tree.kind) + ", the first octree's " +
                          occupancy_name(all.tree.kind));
  all.tree = overlay(all.tree, next.tree);
  all.bytes += next.bytes;
  return {};
}

}  // namespace

bool any_octree(const std::vector<std::string>& paths) {
  return std::any_of(paths.begin(), paths.end(), is_octree_file);
}

Result<OctreeFile> read_octrees(const std::vector<std::string>& paths) {
  std::optional<OctreeFile> all;
  for (const std::string& path : paths) {
    if (!is_octree_file(path))
      return make_error(
          ErrorCode::kInvalidArgument,
          path + ": is no octree, and points are not mixed with octrees: add them with 'update'");
    auto next = read_octree(path);
    if (!next.ok()) return with_file(path, next.error());
    if (all) {
      MAPCODEC_TRY(lay_over(*all, *next, path));
    } else {
      all = std::move(*next);
    }
  }
  return std::move(*all);
}

Result<std::optional<OctreeFile>> octree_of(const MapFile& map, const ReadSettings& settings) {
  std::optional<OctreeFile> file;
  if (!octree_submap(map.archive().info()) && !map.schema().occupancy) return file;
  MAPCODEC_ASSIGN(const OccupancyMap octree, OccupancyMap::open(map.path(), map.archive().revision()));
  MAPCODEC_ASSIGN(OccupancyTree tree, octree.read({}, settings));
  if (tree.root == Cell::unknown) return file;
  file.emplace();
  file->tree = std::move(tree);
  file->resolution_m = octree.resolution_m();
  return file;
}

Result<CompressReport> compress_octrees(const std::vector<std::string>& inputs, const std::string& path,
                                        const CompressOptions& options) {
  const auto begin = Clock::now();
  MAPCODEC_ASSIGN(const OctreeFile file, read_octrees(inputs));
  CompressReport report;
  report.survey_seconds = seconds_since(begin);
  Arena arena(options.threads);
  OccupancyWrite write;
  write.arena = &arena;
  write.input_bytes = file.bytes;
  write.overwrite = options.overwrite;
  write.progress = options.progress;
  write.stop = options.stop;
  MAPCODEC_TRY(create_occupancy_map(path, file.tree, file.resolution_m, write));
  report.points = file.tree.leaf_count();
  report.codings = 1;
  report.threads = arena.threads();
  report.seconds = seconds_since(begin);
  report.tiles_seconds = report.seconds - report.survey_seconds;
  return report;
}

Result<UpdateReport> update_octrees(const std::string& map_path, const UpdateRequest& request, Arena& arena) {
  if (request.pose || !request.submap.empty())
    return make_error(ErrorCode::kInvalidArgument,
                      "an octree lies on its own grid: it takes no pose and no submap");
  MAPCODEC_ASSIGN(const OctreeFile file, read_octrees(request.inputs));
  OccupancyWrite write;
  write.arena = &arena;
  write.input_bytes = file.bytes;
  write.timestamp_s = request.timestamp_s;
  write.stop = request.settings.stop;
  return update_occupancy_map(map_path, file.tree, file.resolution_m, write);
}

Result<DecompressReport> decompress_octree(const std::string& map_path, const std::string& path,
                                           const Region& region, std::optional<std::uint64_t> revision,
                                           const ReadSettings& settings) {
  const auto begin = Clock::now();
  MAPCODEC_ASSIGN(const OccupancyMap map, OccupancyMap::open(map_path, revision));
  MAPCODEC_ASSIGN(const OccupancyTree tree, map.read(region, settings));
  if (tree.root == Cell::unknown)
    return make_error(ErrorCode::kEmpty, "nothing is known in the asked region");
  DecompressReport report;
  report.points = tree.leaf_count();
  report.first_point_seconds = seconds_since(begin);
  MAPCODEC_TRY(write_octree(path, tree, map.resolution_m()));
  report.tiles_read = map.tiles_in(region).size();
  report.bytes_read = map.file().archive().bytes_read();
  report.seconds = seconds_since(begin);
  return report;
}

}  // namespace mapcodec
