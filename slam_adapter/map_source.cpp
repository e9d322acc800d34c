// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/map_source.hpp"

#include <algorithm>

#include "maps/submap_pose.hpp"
#include "slam_adapter/octomap/octree_jobs.hpp"

namespace mapcodec {

MapSource::MapSource(const MapFile& map) : map_(map), layout_(map.schema().layout()), cloud_(layout_) {
  const std::vector<Submap>& submaps = map.archive().info().submaps;
  for (std::uint32_t s = 0; s < submaps.size(); ++s) {
    if (!pose_of(map.archive().info(), s).is_identity())
      layout_.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
  }
}

std::optional<std::uint64_t> MapSource::announced_points() const {
  std::uint64_t points = 0;
  for (const std::size_t i : map_.tiles_in({})) points += map_.archive().tiles()[i].points;
  return points;
}

Result<bool> MapSource::next(PointCloud& block) {
  constexpr std::size_t kBlock = 65536;
  while (at_ >= cloud_.size() && tile_ < map_.archive().tiles().size()) {
    const std::size_t i = tile_++;
    if (map_.archive().tiles()[i].submap == octree_submap(map_.archive().info())) continue;
    MAPCODEC_ASSIGN(cloud_, map_.read_tile(i));
    at_ = 0;
  }
  block = layout_;
  const std::size_t end = std::min(cloud_.size(), at_ + kBlock);
  block.append(cloud_, at_, end);
  at_ = end;
  return !block.empty();
}

Status MapSource::rewind() {
  tile_ = at_ = 0;
  cloud_ = layout_;
  return {};
}

Result<CompressReport> flatten_map(const std::string& map_path, const std::string& path,
                                   CompressOptions options) {
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path));
  const MapSchema& schema = map.schema();
  if (schema.promise == PromiseKind::paper)
    return make_error(ErrorCode::kUnsupported, "a map by the paper's method has no submaps to flatten");
  if (schema.occupancy)
    return make_error(ErrorCode::kUnsupported,
                      "is a map of an octree alone, which has no submaps to flatten");
  MAPCODEC_ASSIGN(const std::optional<OctreeFile> octree, octree_of(map, {}));
  if (octree) {
    options.beside = [&octree](MapWriter& writer) -> Status {
      const auto laid = lay_octree(writer, octree->tree, octree->resolution_m, {});
      return laid.ok() ? Status{} : Status(laid.error());
    };
  }
  options.promise = schema.promise;
  options.promise_m = schema.promise_value;
  for (const ChannelSchema& c : schema.channels) {
    if (c.info.name == "rgb") options.color_error = c.kept == ChannelKept::bounded ? c.bound : 0;
  }
  options.input_bytes = map.archive().info().input_bytes;
  MapSource source(map);
  return compress(source, path, options);
}

}  // namespace mapcodec
