// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/local_map_tile.hpp"

#include <algorithm>

#include "mapcodec/codec/tile_levels.hpp"
#include "mapcodec/codec/tile_patches.hpp"
#include "mapcodec/codec/tile_segments.hpp"
#include "parallel/guard.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kPatchBytes = sizeof(LocalPatch) + sizeof(Point3f) + TileIndex::kBytesPerPoint;

bool has_surfaces(const TileRecord& tile) {
  const auto codec = static_cast<CodecId>(tile.codec);
  return codec == CodecId::surface || codec == CodecId::paper || codec == CodecId::joined;
}

std::uint64_t segment_bytes(const TileRecord& tile) {
  std::uint64_t bytes = 0;
  for (const SegmentRef& s : tile.segments) bytes += s.length;
  return bytes;
}

/// No patch needs its points' colours, and reading them would mean placing all points.
MapSchema without_colors(MapSchema schema) {
  for (ChannelSchema& c : schema.channels) c.info.name.clear();
  return schema;
}

/// Builds one tile; each step takes what the one before left.
class Loading {
 public:
  Loading(const MapArchive& archive, const MapSchema& schema, const TileRecord& record, DecodeLimits limits)
      : archive_(archive),
        schema_(schema),
        record_(record),
        limits_(limits),
        tile_(std::make_shared<LocalTile>()) {
    // What was reserved follows from the archive's count: a payload that holds more must not get it. Segments
    // of which some points were erased hold more for a moment.
    if (record.segments.size() == 1 && record.codec != static_cast<std::uint8_t>(CodecId::joined))
      limits_.max_points = std::min(limits_.max_points, record.points);
    tile_->key = record.key;
    tile_->submap = record.submap;
    for (std::size_t d = 0; d < 3 && !record.bounds.empty(); ++d)
      tile_->origin[d] = (record.bounds.min[d] + record.bounds.max[d]) / 2;
  }

  Result<std::shared_ptr<LocalTile>> run(const LocalContent& content, std::optional<unsigned> level) {
    tile_->level = level;
    std::vector<Bytes> segments;
    for (const SegmentRef& segment : record_.segments) {
      MAPCODEC_ASSIGN(Bytes bytes, archive_.read(segment));
      segments.push_back(std::move(bytes));
    }
    const Bytes bytes = join_segments(segments);
    if (content.patches && !level) MAPCODEC_TRY(add_patches(bytes));
    if (content.points) MAPCODEC_TRY(add_points(bytes, content.channels));
    if (level) drop_equal_points();
    for (const LocalPatch& p : tile_->patches) tile_->patch_centers.push_back(p.center);
    tighten();
    measure();
    if (content.index) {
      tile_->point_index = TileIndex(tile_->points);
      tile_->patch_index = TileIndex(tile_->patch_centers);
    }
    return tile_;
  }

 private:
  Error damaged(const Error& e) const {
    return make_error(ErrorCode::kArchiveDamaged, "tile " + tile_name(record_) + ": " + e.message, e.offset);
  }
  Point3f keep(const Vec3& p) const {
    const Vec3 d = tile_->to_origin(p);
    return {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])};
  }

  Status add_points(ByteSpan bytes, bool channels) {
    auto decoded = tile_->level ? decode_tile_coarsely(bytes, schema_, *tile_->level, limits_)
                                : decode_tile(bytes, schema_, limits_);
    if (!decoded.ok()) return damaged(decoded.error());
    if (decoded->size() > record_.points)
      return damaged({ErrorCode::kMalformed, "more points than the index says", {}});
    if (tile_->points.empty()) tile_->points.reserve(decoded->size());
    for (const Vec3& p : decoded->xyz) {
      const Point3f q = keep(p);
      if (!is_finite({q[0], q[1], q[2]}))
        return damaged({ErrorCode::kMalformed, "a point is not finite", {}});
      tile_->points.push_back(q);
    }
    if (channels) add_channels(std::move(*decoded));
    return {};
  }

  void add_channels(PointCloud decoded) {
    if (tile_->channels.empty()) {
      tile_->channels = std::move(decoded.channels);
      return;
    }
    for (std::size_t c = 0; c < decoded.channels.size(); ++c) {
      const Bytes& more = decoded.channels[c].data;
      tile_->channels[c].data.insert(tile_->channels[c].data.end(), more.begin(), more.end());
    }
  }

  Status add_patches(ByteSpan bytes) {
    const auto read = read_tile_patches(bytes, without_colors(schema_), limits_);
    if (!read.ok()) return damaged(read.error());
    tile_->patches.reserve(tile_->patches.size() + read->patches.size());
    for (const SurfacePatch& p : read->patches) {
      if (!is_finite(p.center) || !is_finite(p.normal)) continue;
      tile_->patches.push_back(disc(p));
    }
    return {};
  }

  LocalPatch disc(const SurfacePatch& p) const {
    double squared = 0;
    for (const Vec3& v : p.polygon) {
      double sum = 0;
      for (std::size_t d = 0; d < 3; ++d) sum += (v[d] - p.center[d]) * (v[d] - p.center[d]);
      squared = std::max(squared, sum);
    }
    LocalPatch r;
    r.center = keep(p.center);
    for (std::size_t d = 0; d < 3; ++d) r.normal[d] = static_cast<float>(p.normal[d]);
    r.radius_m = static_cast<float>(std::sqrt(squared));
    r.area_m2 = static_cast<float>(p.area_m2);
    r.noise_m = static_cast<float>(p.noise_m);
    r.points = static_cast<std::uint32_t>(std::min<std::uint64_t>(p.points, 0xffffffffu));
    return r;
  }

  void drop_equal_points() {
    std::vector<Point3f>& points = tile_->points;
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
  }

  void tighten() {
    tile_->points.shrink_to_fit();
    tile_->patches.shrink_to_fit();
    tile_->patch_centers.shrink_to_fit();
    for (Channel& c : tile_->channels) c.data.shrink_to_fit();
  }

  void measure() {
    for (const Point3f& p : tile_->points) tile_->bounds.add(tile_->from_origin(p));
    for (const Point3f& p : tile_->patch_centers) tile_->bounds.add(tile_->from_origin(p));
  }

  const MapArchive& archive_;
  const MapSchema& schema_;
  const TileRecord& record_;
  DecodeLimits limits_;
  std::shared_ptr<LocalTile> tile_;
};

}  // namespace

std::uint64_t LocalTile::bytes() const {
  std::uint64_t sum = sizeof(LocalTile) + point_index.bytes() + patch_index.bytes();
  sum += points.capacity() * sizeof(Point3f) + patches.capacity() * sizeof(LocalPatch);
  sum += patch_centers.capacity() * sizeof(Point3f);
  for (const Channel& c : channels) sum += sizeof(Channel) + c.data.capacity();
  return sum;
}

std::uint64_t bytes_to_load(const TileRecord& tile, const MapSchema& schema, const LocalContent& content,
                            bool coarse) {
  std::uint64_t per_point = 0;
  if (content.points) {
    per_point = sizeof(Vec3) + sizeof(Point3f) + (content.index ? TileIndex::kBytesPerPoint : 0);
    for (const ChannelSchema& c : schema.channels) {
      // Decoded with the points even where they are not kept.
      if (!coarse && c.kept != ChannelKept::dropped)
        per_point += (content.channels ? 2 : 1) * c.info.stride();
    }
  }
  // A patch has three points or more, nearly always.
  if (content.patches && !coarse && has_surfaces(tile)) per_point += kPatchBytes / 3;
  constexpr std::uint64_t kOverhead = 4096 + sizeof(LocalTile);
  const std::uint64_t points =
      std::min(tile.points, ~std::uint64_t{0} / (4 * std::max<std::uint64_t>(1, per_point)));
  return segment_bytes(tile) + points * per_point + kOverhead;
}

Result<std::shared_ptr<const LocalTile>> load_local_tile(const MapArchive& archive, const MapSchema& schema,
                                                         const TileRecord& tile, const LocalContent& content,
                                                         std::optional<unsigned> level,
                                                         const DecodeLimits& limits, Reservation reserved) {
  return parallel_detail::guarded("loading a tile", [&]() -> Result<std::shared_ptr<const LocalTile>> {
    Loading loading(archive, schema, tile, limits);
    MAPCODEC_ASSIGN(const std::shared_ptr<LocalTile> loaded, loading.run(content, level));
    if (!reserved.resize(loaded->bytes())) {
      return make_error(ErrorCode::kLimitExceeded,
                        "tile " + tile_name(tile) + " takes more memory than its points let expect");
    }
    loaded->held = std::move(reserved);
    return std::shared_ptr<const LocalTile>(loaded);
  });
}

}  // namespace mapcodec
