// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/map_file.hpp"

#include <algorithm>
#include <fstream>
#include <numeric>

#include "mapcodec/codec/tile_segments.hpp"
#include "maps/moved_points.hpp"
#include "maps/store_schemes.hpp"
#include "maps/submap_pose.hpp"
#include "parallel/encode_pipeline.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"

namespace mapcodec {
namespace {

PointCloud inside(PointCloud cloud, const Region& region) {
  std::vector<std::uint32_t> keep;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (region.contains(cloud.xyz[i])) keep.push_back(static_cast<std::uint32_t>(i));
  }
  return keep.size() == cloud.size() ? std::move(cloud) : cloud.gather(keep);
}

/// From the frame of a submap to the map's.
void move_to_map(PointCloud& cloud, const MapInfo& info, std::uint32_t submap) {
  move_points(cloud, pose_of(info, submap));
}

/// Of a tile, in the map's frame.
Box posed_bounds(const MapInfo& info, const TileRecord& tile) {
  return pose_of(info, tile.submap).apply(tile.bounds);
}

/// A payload that passed its checksum and still does not decode means a damaged archive, whatever the decoder
/// calls it.
Error damaged(const Error& e) {
  if (e.code == ErrorCode::kCancelled || e.code == ErrorCode::kCannotWrite) return e;
  return make_error(ErrorCode::kArchiveDamaged, e.message, e.offset);
}

std::vector<std::size_t> border_tiles(const MapFile& map, const Region& region,
                                      std::uint64_t& points_inside) {
  std::vector<std::size_t> border;
  for (const std::size_t i : map.tiles_in(region)) {
    const TileRecord& tile = map.archive().tiles()[i];
    if (region.contains(posed_bounds(map.archive().info(), tile))) {
      points_inside += tile.points;
    } else {
      border.push_back(i);
    }
  }
  return border;
}

}  // namespace

bool Region::contains(const Vec3& p) const {
  if (everything()) return true;
  if (box && !box->contains(p)) return false;
  if (!sphere) return true;
  double d2 = 0;
  for (std::size_t d = 0; d < 3; ++d) d2 += (p[d] - sphere->centre[d]) * (p[d] - sphere->centre[d]);
  return d2 <= sphere->radius_m * sphere->radius_m;
}

bool Region::contains(const Box& b) const {
  if (everything()) return true;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p{(corner & 1) ? b.max[0] : b.min[0], (corner & 2) ? b.max[1] : b.min[1],
                 (corner & 4) ? b.max[2] : b.min[2]};
    if (!contains(p)) return false;
  }
  return !b.empty();
}

Box Region::bounds() const {
  if (box) return *box;
  constexpr double kInf = std::numeric_limits<double>::infinity();
  if (!sphere) return {{-kInf, -kInf, -kInf}, {kInf, kInf, kInf}};
  Box b;
  for (std::size_t d = 0; d < 3; ++d) {
    b.min[d] = sphere->centre[d] - sphere->radius_m;
    b.max[d] = sphere->centre[d] + sphere->radius_m;
  }
  return b;
}

Result<MapFile> MapFile::open(const std::string& path, std::optional<std::uint64_t> revision) {
  MAPCODEC_ASSIGN(MapArchive archive, MapArchive::open(path, revision));
  auto schema = read_schema(archive.info().schema);
  if (!schema.ok()) return damaged(schema.error());
  return MapFile(path, std::make_unique<MapArchive>(std::move(archive)), std::move(schema).value());
}

MapSummary MapFile::summary() const {
  MapSummary s;
  s.tiles = archive_->tiles().size();
  const auto octree = octree_submap(archive_->info());
  for (const TileRecord& t : archive_->tiles()) {
    MapSummary::CodecTotals& c = s.codecs[codec_name(static_cast<CodecId>(t.codec))];
    c.tiles += 1;
    c.points += t.points;
    for (const SegmentRef& segment : t.segments) c.bytes += segment.length;
    if (t.submap != octree) s.points += t.points;
  }
  const MapInfo& info = archive_->info();
  s.bytes = archive_->file_bytes();
  s.input_bytes = info.input_bytes;
  s.raw_bytes = raw_bytes_per_point(schema_) * info.input_points;
  s.bits_per_point = info.input_points == 0 ? 0 : 8.0 * double(s.bytes) / double(info.input_points);
  s.ratio = s.raw_bytes == 0 ? 0 : double(s.bytes) / double(s.raw_bytes);
  s.achieved = info.achieved;
  s.bounds = info.bounds;
  if (const auto levels = info.extras.find(kLevelsExtra); levels != info.extras.end()) {
    // What a later version wrote otherwise is no reason not to show the rest.
    if (auto read = read_level_errors(levels->second); read.ok()) s.levels = std::move(read).value();
    // They were measured on a sample; of the whole map the last one is known, and no other is better.
    for (LevelErrors::Level& l : s.levels.levels) l.rms_m = std::max(l.rms_m, info.achieved.rms_m);
    if (!s.levels.levels.empty()) s.levels.levels.back().rms_m = info.achieved.rms_m;
  }
  return s;
}

std::vector<std::size_t> MapFile::tiles_in(const Region& region) const {
  std::vector<std::size_t> all(archive_->tiles().size());
  if (region.everything())
    std::iota(all.begin(), all.end(), std::size_t{0});
  else
    all = archive_->tiles_in(region.bounds());
  if (const auto octree = octree_submap(archive_->info()))
    std::erase_if(all, [&](std::size_t i) { return archive_->tiles()[i].submap == *octree; });
  return all;
}

Result<Bytes> MapFile::fetch(std::size_t index) const {
  const std::vector<SegmentRef>& segments = archive_->tiles()[index].segments;
  if (segments.size() == 1) return archive_->read(segments.front());
  std::vector<Bytes> all;
  for (const SegmentRef& segment : segments) {
    MAPCODEC_ASSIGN(Bytes bytes, archive_->read(segment));
    all.push_back(std::move(bytes));
  }
  return join_segments(all);
}

Result<PointCloud> MapFile::read_tile_in_submap(std::size_t index, const DecodeLimits& limits) const {
  MAPCODEC_ASSIGN(const Bytes bytes, fetch(index));
  auto cloud = decode_tile(bytes, schema_, limits);
  if (!cloud.ok()) return damaged(cloud.error());
  return cloud;
}

Result<PointCloud> MapFile::read_tile(std::size_t index, const DecodeLimits& limits) const {
  MAPCODEC_ASSIGN(PointCloud cloud, read_tile_in_submap(index, limits));
  move_to_map(cloud, archive_->info(), archive_->tiles()[index].submap);
  return cloud;
}

namespace {

/// Decodes the named tiles in order, on the arena if there is one.
Status decode_each(const MapFile& map, const std::vector<std::size_t>& tiles, const ReadSettings& settings,
                   const std::function<Result<Bytes>(std::size_t)>& fetch,
                   const std::function<Status(std::size_t, PointCloud&&)>& sink) {
  PipelineSettings pipeline;
  pipeline.arena = settings.arena;
  pipeline.progress = settings.progress;
  pipeline.stop = settings.stop;
  const auto fetch_nth = [&](std::size_t i) { return fetch(tiles[i]); };
  const auto sink_nth = [&](std::size_t i, PointCloud&& cloud) {
    move_to_map(cloud, map.archive().info(), map.archive().tiles()[tiles[i]].submap);
    return sink(tiles[i], std::move(cloud));
  };
  const auto decode = [&](ByteSpan bytes) {
    return settings.level ? decode_tile_coarsely(bytes, map.schema(), *settings.level, settings.limits)
                          : decode_tile(bytes, map.schema(), settings.limits);
  };
  const Status s = decode_tiles(tiles.size(), fetch_nth, decode, pipeline, sink_nth);
  return s.ok() ? s : Status(damaged(s.error()));
}

}  // namespace

Result<std::uint64_t> MapFile::count(const Region& region, const ReadSettings& settings) const {
  std::uint64_t total = 0;
  const std::vector<std::size_t> border = border_tiles(*this, region, total);
  MAPCODEC_TRY(decode_each(
      *this, border, settings, [this](std::size_t i) { return fetch(i); },
      [&](std::size_t, PointCloud&& cloud) {
        total += inside(std::move(cloud), region).size();
        return Status{};
      }));
  return total;
}

Status MapFile::read(const Region& region, const ReadSettings& settings,
                     const std::function<Status(PointCloud&&)>& sink) const {
  return decode_each(
      *this, tiles_in(region), settings, [this](std::size_t i) { return fetch(i); },
      [&](std::size_t i, PointCloud&& cloud) {
        const bool whole = region.contains(posed_bounds(archive_->info(), archive_->tiles()[i]));
        return sink(whole ? std::move(cloud) : inside(std::move(cloud), region));
      });
}

Result<PointCloud> MapFile::read(const Region& region, const ReadSettings& settings) const {
  PointCloud all = layout(settings);
  MAPCODEC_TRY(read(region, settings, [&](PointCloud&& cloud) {
    all.append(cloud);
    return Status{};
  }));
  return all;
}

PointCloud MapFile::layout(const ReadSettings& settings) const {
  PointCloud layout = schema_.layout();
  if (settings.level) layout.channels.clear();
  return layout;
}

bool MapFile::has_surfaces() const {
  return std::any_of(archive_->tiles().begin(), archive_->tiles().end(), [](const TileRecord& t) {
    const auto codec = static_cast<CodecId>(t.codec);
    return codec == CodecId::surface || codec == CodecId::paper || codec == CodecId::joined;
  });
}

bool MapFile::has_levels() const {
  return std::any_of(archive_->tiles().begin(), archive_->tiles().end(), [](const TileRecord& t) {
    const auto codec = static_cast<CodecId>(t.codec);
    return codec == CodecId::surface || codec == CodecId::points || codec == CodecId::joined;
  });
}

namespace {

void move_to_map(TilePatches& tile, const RigidMotion& pose) {
  if (pose.is_identity()) return;
  for (SurfacePatch& p : tile.patches) {
    p.center = pose.apply(p.center);
    p.normal = pose.rotate(p.normal);
    for (Vec3& corner : p.polygon) corner = pose.apply(corner);
  }
}

void keep_inside(TilePatches& tile, const Region& region) {
  std::erase_if(tile.patches, [&](const SurfacePatch& p) { return !region.contains(p.center); });
}

/// Takes the tiles some at a time, so that a map of any size has few of them in memory.
struct PatchBatch {
  std::vector<std::size_t> tiles;
  std::vector<Bytes> bytes;
  std::vector<Result<TilePatches>> read;

  void decode(const MapSchema& schema, const ReadSettings& settings) {
    read.assign(tiles.size(), TilePatches{});
    const auto some = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        read[i] = read_tile_patches(bytes[i], schema, settings.limits);
    };
    if (settings.arena == nullptr) return some(0, tiles.size());
    TbbRunner runner(*settings.arena);
    runner.run(tiles.size(), some);
  }
};

}  // namespace

Status MapFile::read_patches(const Region& region, const ReadSettings& settings,
                             const std::function<Status(std::size_t, TilePatches&&)>& sink) const {
  const std::vector<std::size_t> tiles = tiles_in(region);
  const std::size_t at_once = settings.arena == nullptr ? 1 : 4 * std::size_t(settings.arena->threads());
  for (std::size_t begin = 0; begin < tiles.size(); begin += at_once) {
    if (settings.stop != nullptr && *settings.stop) return make_error(ErrorCode::kCancelled, "stopped");
    PatchBatch batch;
    for (std::size_t i = begin; i < std::min(begin + at_once, tiles.size()); ++i) {
      batch.tiles.push_back(tiles[i]);
      MAPCODEC_ASSIGN(Bytes bytes, fetch(tiles[i]));
      batch.bytes.push_back(std::move(bytes));
    }
    batch.decode(schema_, settings);
    for (std::size_t i = 0; i < batch.tiles.size(); ++i) {
      if (!batch.read[i].ok()) return damaged(batch.read[i].error());
      const TileRecord& tile = archive_->tiles()[batch.tiles[i]];
      move_to_map(*batch.read[i], pose_of(archive_->info(), tile.submap));
      if (!region.contains(posed_bounds(archive_->info(), tile))) keep_inside(*batch.read[i], region);
      MAPCODEC_TRY(sink(batch.tiles[i], std::move(*batch.read[i])));
    }
  }
  return {};
}

bool is_map_file(const std::string& path) {
  if (has_store_scheme(path)) return true;
  char head[4] = {};
  std::ifstream(path, std::ios::binary).read(head, sizeof head);
  return std::string_view(head + 1, 3) == "MPC";
}

PointCloud restore_order(PointCloud cloud) {
  const Channel* index = cloud.find(kOrderChannel);
  if (index == nullptr) return cloud;
  std::vector<std::uint32_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return index->get<std::uint64_t>(a) < index->get<std::uint64_t>(b);
  });
  PointCloud sorted = cloud.gather(order);
  std::erase_if(sorted.channels, [](const Channel& c) { return c.info.name == kOrderChannel; });
  return sorted;
}

}  // namespace mapcodec
