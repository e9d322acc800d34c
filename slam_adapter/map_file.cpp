// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/map_file.hpp"

#include <algorithm>
#include <fstream>
#include <numeric>

#include "parallel/encode_pipeline.hpp"
#include "slam_adapter/compress.hpp"

namespace mapcodec {
namespace {

PointCloud inside(PointCloud cloud, const Region& region) {
  std::vector<std::uint32_t> keep;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (region.contains(cloud.xyz[i])) keep.push_back(static_cast<std::uint32_t>(i));
  }
  return keep.size() == cloud.size() ? std::move(cloud) : cloud.gather(keep);
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
    if (region.contains(tile.bounds)) {
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
  for (const TileRecord& t : archive_->tiles()) {
    MapSummary::CodecTotals& c = s.codecs[codec_name(static_cast<CodecId>(t.codec))];
    c.tiles += 1;
    c.points += t.points;
    for (const SegmentRef& segment : t.segments) c.bytes += segment.length;
    s.points += t.points;
  }
  const MapInfo& info = archive_->info();
  s.bytes = archive_->file_bytes();
  s.input_bytes = info.input_bytes;
  s.raw_bytes = raw_bytes_per_point(schema_) * info.input_points;
  s.bits_per_point = info.input_points == 0 ? 0 : 8.0 * double(s.bytes) / double(info.input_points);
  s.ratio = s.raw_bytes == 0 ? 0 : double(s.bytes) / double(s.raw_bytes);
  s.achieved = info.achieved;
  s.bounds = info.bounds;
  return s;
}

std::vector<std::size_t> MapFile::tiles_in(const Region& region) const {
  if (region.everything()) {
    std::vector<std::size_t> all(archive_->tiles().size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    return all;
  }
  return archive_->tiles_in(region.bounds());
}

Result<Bytes> MapFile::fetch(std::size_t index) const {
  const std::vector<SegmentRef>& segments = archive_->tiles()[index].segments;
  if (segments.size() != 1) {
    return make_error(ErrorCode::kUnsupported,
                      "a tile of " + std::to_string(segments.size()) +
                          " segments: this version reads maps that were not updated in place");
  }
  return archive_->read(segments.front());
}

Result<PointCloud> MapFile::read_tile(std::size_t index, const DecodeLimits& limits) const {
  MAPCODEC_ASSIGN(const Bytes bytes, fetch(index));
  auto cloud = decode_tile(bytes, schema_, limits);
  if (!cloud.ok()) return damaged(cloud.error());
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
  const auto sink_nth = [&](std::size_t i, PointCloud&& cloud) { return sink(tiles[i], std::move(cloud)); };
  const Status s = decode_tiles(tiles.size(), fetch_nth, map.schema(), settings.limits, pipeline, sink_nth);
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
        const bool whole = region.contains(archive_->tiles()[i].bounds);
        return sink(whole ? std::move(cloud) : inside(std::move(cloud), region));
      });
}

Result<PointCloud> MapFile::read(const Region& region, const ReadSettings& settings) const {
  PointCloud all = schema_.layout();
  MAPCODEC_TRY(read(region, settings, [&](PointCloud&& cloud) {
    all.append(cloud);
    return Status{};
  }));
  return all;
}

bool is_map_file(const std::string& path) {
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
