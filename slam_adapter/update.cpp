// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/update.hpp"

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "mapcodec/cloud/normals.hpp"
#include "maps/moved_points.hpp"
#include "slam_adapter/create_map.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/octomap/octree_jobs.hpp"
#include "slam_adapter/point_batch.hpp"
#include "slam_adapter/scan_submaps.hpp"

namespace mapcodec {
namespace {

std::string number(double v) {
  std::ostringstream out;
  out << v;
  return out.str();
}

std::string promise_text(PromiseKind kind, double value_m) {
  return promise_name(kind) + (value_m > 0 ? " " + number(value_m) + " m" : std::string());
}

Status check_promise(const MapSchema& schema, const UpdateRequest& r) {
  const bool same = !r.promise || (*r.promise == schema.promise && r.promise_m == schema.promise_value);
  if (!same) {
    return make_error(ErrorCode::kInvalidArgument,
                      "the map promises " + promise_text(schema.promise, schema.promise_value) +
                          ": an update cannot promise " + promise_text(*r.promise, r.promise_m));
  }
  for (const ChannelSchema& c : schema.channels) {
    if (!r.color_error || c.info.name != "rgb") continue;
    const bool kept = c.kept == ChannelKept::bounded ? c.bound == *r.color_error
                                                     : c.kept == ChannelKept::exact && *r.color_error == 0;
    if (!kept)
      return make_error(ErrorCode::kInvalidArgument,
                        "the map keeps colours within " + number(c.bound) + ": an update cannot change that");
  }
  return {};
}

void place(PointCloud& cloud, const RigidMotion& pose) {
  if (pose.is_identity()) return;
  move_points(cloud, pose);
  cloud.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
}

Error named(const std::string& path, const Error& e) {
  if (e.message.find(path) != std::string::npos) return e;
  return make_error(e.code, path + ": " + e.message, e.offset);
}

void say_unkept(const std::string& path, const PointCloud& layout, const MapSchema& schema,
                std::vector<std::string>& warnings) {
  const std::vector<std::string> names = unkept_channels(layout, schema);
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  if (!names.empty()) warnings.push_back(path + ": the map does not keep " + all);
}

Status insert_source(MapUpdater& map, PointSource& source, const RigidMotion& pose, std::uint32_t submap) {
  PointCloud block;
  for (;;) {
    MAPCODEC_ASSIGN(const bool more, source.next(block));
    if (!more) {
      map.end_scan();
      return {};
    }
    PointCloud points = std::exchange(block, {});
    place(points, pose);
    MAPCODEC_TRY(map.insert(std::move(points), submap, MapUpdater::ScanEnd::later));
  }
}

Status insert_file(MapUpdater& map, const std::string& path, const UpdateRequest& r, std::uint32_t submap,
                   std::vector<std::string>& warnings) {
  ReadOptions read;
  read.keep_nonfinite = map.schema().promise == PromiseKind::lossless;
  read.unit_m = r.unit_m;
  read.bag = r.bag;
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_source(path, read));
  say_unkept(path, source->layout(), map.schema(), warnings);
  if (const auto normals = unturned_normals(source->layout()); normals && r.pose)
    warnings.push_back(path + ": the channel " + *normals +
                       " stays as it is: only \"normal\" of three floats or doubles turns with the pose");
  const RigidMotion pose =
      r.pose && r.submap.empty() ? RigidMotion(r.pose->translation_m, r.pose->rotation_xyzw) : RigidMotion();
  if (const Status s = insert_source(map, *source, pose, submap); !s.ok()) return named(path, s.error());
  const std::vector<std::string> said = source->warnings();
  warnings.insert(warnings.end(), said.begin(), said.end());
  return {};
}

Result<MapUpdater> open_or_create(const std::string& map_path, const UpdateRequest& r, Arena& arena,
                                  std::vector<std::string>& warnings) {
  std::error_code ignored;
  if (!r.create || std::filesystem::exists(map_path, ignored))
    return MapUpdater::open(map_path, arena, r.settings);
  ReadOptions read;
  read.keep_nonfinite = r.create->promise == PromiseKind::lossless;
  read.unit_m = r.unit_m;
  read.bag = r.bag;
  // Submaps hold scans as the sensor saw them.
  if (r.each_scan) read.bag.poses = BagOptions::Poses::none;
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> first, open_source(r.inputs.front(), read));
  auto map = create_map(map_path, *first, *r.create, arena, r.settings, warnings);
  if (!map.ok() && map.error().code != ErrorCode::kCannotWrite) return named(r.inputs.front(), map.error());
  return map;
}

/// The name that a submap of another archive gets here.
std::string free_name(const MapUpdater& map, const std::string& name, const std::string& path) {
  const auto taken = [&](const std::string& n) {
    return std::any_of(map.info().submaps.begin(), map.info().submaps.end(),
                       [&](const Submap& s) { return s.name == n; });
  };
  const std::string stem = std::filesystem::path(path).stem().string();
  std::string free = name.empty() ? stem : name;
  if (taken(free)) free = stem + "/" + free;
  for (int i = 2; taken(free); ++i) free = stem + "/" + name + "-" + std::to_string(i);
  return free;
}

Status merge_tiles(MapUpdater& map, const MapFile& other, bool fuse, const std::string& path) {
  std::vector<std::optional<std::uint32_t>> numbers(
      std::max<std::size_t>(1, other.archive().info().submaps.size()));
  for (std::size_t i = 0; i < other.archive().tiles().size(); ++i) {
    const TileRecord& tile = other.archive().tiles()[i];
    if (tile.submap == octree_submap(other.archive().info())) continue;
    const bool apart = !fuse && tile.submap < other.archive().info().submaps.size() &&
                       !other.archive().info().submaps[tile.submap].name.empty();
    if (!apart) {
      MAPCODEC_ASSIGN(PointCloud cloud, other.read_tile(i));
      MAPCODEC_TRY(map.insert(std::move(cloud), 0));
      continue;
    }
    const Submap& from = other.archive().info().submaps[tile.submap];
    if (!numbers[tile.submap]) {
      const PoseChange pose{0, from.translation_m, from.rotation_xyzw};
      MAPCODEC_ASSIGN(numbers[tile.submap], map.submap(free_name(map, from.name, path), pose));
    }
    MAPCODEC_ASSIGN(PointCloud cloud, other.read_tile_in_submap(i));
    MAPCODEC_TRY(map.insert(std::move(cloud), *numbers[tile.submap]));
  }
  return {};
}

Result<std::vector<MapFile>> open_others(const std::string& map_path, const std::vector<std::string>& paths) {
  std::vector<MapFile> others;
  for (const std::string& path : paths) {
    std::error_code ignored;
    if (std::filesystem::equivalent(path, map_path, ignored))
      return make_error(ErrorCode::kInvalidArgument, path + ": a map cannot be merged with itself");
    MAPCODEC_ASSIGN(MapFile other, MapFile::open(path));
    others.push_back(std::move(other));
  }
  return others;
}

void add_tiles(UpdateReport& sum, const UpdateReport& r) {
  sum.tiles_touched += r.tiles_touched;
  sum.tiles_new += r.tiles_new;
  sum.tiles_removed += r.tiles_removed;
  sum.bytes += r.bytes;
  sum.committed = sum.committed || r.committed;
}

/// @param sum  in, out: what the octrees changed.
Status merge_octree(MapWriter& writer, const MapFile& other, const MergeRequest& request, Arena& arena,
                    UpdateReport& sum, std::vector<std::string>& warnings) {
  ReadSettings read;
  read.arena = &arena;
  read.stop = request.settings.stop;
  const auto octree = octree_of(other, read);
  if (!octree.ok()) return named(other.path(), octree.error());
  if (!*octree) return {};
  OccupancyWrite write;
  write.arena = &arena;
  write.stop = request.settings.stop;
  const bool alone = other.schema().occupancy.has_value();
  if (alone) write.input_bytes = other.archive().info().input_bytes;
  const auto laid = lay_octree(writer, (*octree)->tree, (*octree)->resolution_m, write);
  if (laid.ok()) {
    add_tiles(sum, *laid);
    return {};
  }
  if (laid.error().code != ErrorCode::kInvalidArgument) return laid.error();  // the map's own
  if (alone) return named(other.path(), laid.error());
  warnings.push_back(other.path() + ": its octree is left out: " + laid.error().message);
  return {};
}

}  // namespace

Result<UpdateReport> update_files(const std::string& map_path, const UpdateRequest& request, Arena& arena,
                                  std::vector<std::string>& warnings) {
  if (request.each_scan && (request.pose || !request.submap.empty() || request.unit_m != 1))
    return make_error(ErrorCode::kInvalidArgument, "scans of a bag bring their own poses, names and metres");
  if (request.pose) MAPCODEC_TRY(check_pose(request.pose->translation_m, request.pose->rotation_xyzw));
  if (std::all_of(request.inputs.begin(), request.inputs.end(), is_octree_file))
    return update_octrees(map_path, request, arena);
  MAPCODEC_ASSIGN(MapUpdater map, open_or_create(map_path, request, arena, warnings));
  MAPCODEC_TRY(check_promise(map.schema(), request));
  std::uint32_t submap = 0;
  if (!request.submap.empty()) {
    MAPCODEC_ASSIGN(submap, map.submap(request.submap, request.pose));
  }
  for (const std::string& path : request.inputs) {
    if (request.each_scan)
      MAPCODEC_TRY(insert_scans(map, path, request.bag, warnings));
    else
      MAPCODEC_TRY(insert_file(map, path, request, submap, warnings));
  }
  for (const std::string& path : request.inputs) {
    MAPCODEC_ASSIGN(const std::uint64_t bytes, input_bytes(path));
    map.add_input_bytes(bytes);
  }
  return map.commit(request.timestamp_s);
}

Result<UpdateReport> merge_maps(const std::string& map_path, const MergeRequest& request, Arena& arena,
                                std::vector<std::string>& warnings) {
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(map_path));
  MAPCODEC_ASSIGN(const std::vector<MapFile> others, open_others(map_path, request.others));
  UpdateReport octrees;
  for (const MapFile& other : others) {
    MAPCODEC_TRY(merge_octree(writer, other, request, arena, octrees, warnings));
  }
  MAPCODEC_ASSIGN(MapUpdater map,
                  MapUpdater::over(std::move(writer), arena, request.settings, octrees.committed));
  for (const MapFile& other : others) {
    if (other.schema().occupancy) continue;
    say_unkept(other.path(), other.schema().layout(), map.schema(), warnings);
    const Status s = merge_tiles(map, other, request.fuse, other.path());
    if (!s.ok()) return named(other.path(), s.error());
    map.add_input_bytes(other.archive().info().input_bytes);
  }
  MAPCODEC_ASSIGN(UpdateReport report, map.commit(request.timestamp_s));
  add_tiles(report, octrees);
  return report;
}

}  // namespace mapcodec
