// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/updater_coding.hpp"

#include "mapcodec/cloud/cloud_source.hpp"
#include "mapcodec/codec/tile_levels.hpp"
#include "slam_adapter/create_map.hpp"
#include "slam_adapter/lattice.hpp"
#include "slam_adapter/point_batch.hpp"

namespace mapcodec {
namespace {

constexpr double kUsualTile = 10;
// Coordinates that a map without a sample is made for [m]: rounding of doubles is reckoned so far out.
constexpr double kFarthest = 1e7;

/// A lossless map of doubles takes floats, too: they are doubles already.
void widen(PointCloud& points, const MapSchema& schema) {
  using Kind = CoordinateFormat::Kind;
  const bool narrow = points.coordinates.kind == Kind::f32 && schema.coordinates.kind == Kind::f64;
  if (schema.promise == PromiseKind::lossless && narrow) points.coordinates = schema.coordinates;
}

class UpdaterEditor final : public MapEditor {
 public:
  explicit UpdaterEditor(MapUpdater updater) : updater_(std::move(updater)) {}

  [[nodiscard]] const MapSchema& schema() const override { return updater_.schema(); }
  [[nodiscard]] const MapInfo& info() const override { return updater_.info(); }
  [[nodiscard]] Result<std::uint32_t> submap(const std::string& name,
                                             const std::optional<PoseChange>& pose) override {
    return updater_.submap(name, pose);
  }
  [[nodiscard]] Status set_poses(std::span<const PoseChange> poses) override {
    return updater_.set_poses(poses);
  }
  [[nodiscard]] Status insert(PointCloud points, std::uint32_t submap) override {
    const std::uint64_t bytes = points.size() * raw_bytes_per_point(updater_.schema());
    widen(points, updater_.schema());
    MAPCODEC_TRY(updater_.insert(std::move(points), submap));
    updater_.add_input_bytes(bytes);
    return {};
  }
  [[nodiscard]] Status erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap) override {
    return updater_.erase(e, submap);
  }
  [[nodiscard]] Status fold() override { return updater_.fold(); }
  void set_extra(const std::string& name, Bytes value) override {
    updater_.set_extra(name, std::move(value));
  }
  [[nodiscard]] Result<EditReport> commit(std::int64_t timestamp_s) override {
    MAPCODEC_ASSIGN(const UpdateReport r, updater_.commit(timestamp_s));
    return EditReport{r.revision, r.committed, r.points_in, r.points_added, r.tiles_touched};
  }

 private:
  MapUpdater updater_;
};

ChannelSchema channel_of(const ChannelInfo& info, const NewMap& map) {
  ChannelSchema c;
  c.info = info;
  const bool color = info.name == "rgb" && info.components == 3 &&
                     (info.scalar == ScalarType::u8 || info.scalar == ScalarType::u16);
  if (color && map.promise != PromiseKind::lossless && map.color_error > 0) {
    c.kept = ChannelKept::bounded;
    c.bound = map.color_error;
  }
  return c;
}

/// The lattice of the promise alone, coordinates as doubles.
MapSchema schema_without_sample(const NewMap& map) {
  MapSchema schema;
  schema.promise = map.promise;
  schema.tile_size_m = map.tile_size_m > 0 ? map.tile_size_m : kUsualTile;
  schema.coordinates.kind = CoordinateFormat::Kind::f64;
  if (map.promise != PromiseKind::lossless) schema.promise_value = map.promise_m;
  if (map.promise == PromiseKind::max_error) {
    const Box far{{-kFarthest, -kFarthest, -kFarthest}, {kFarthest, kFarthest, kFarthest}};
    const Lattice lattice = lattice_for_max_error(map.promise_m, schema.coordinates, far, schema.origin);
    schema.origin = lattice.origin;
    schema.step_m = lattice.step_m;
  }
  for (const ChannelInfo& c : map.channels) schema.channels.push_back(channel_of(c, map));
  return schema;
}

Status check_new(const NewMap& map) {
  const bool measured = map.promise == PromiseKind::rms || map.promise == PromiseKind::max_error;
  if (!measured && map.promise != PromiseKind::lossless)
    return make_error(ErrorCode::kUnsupported, "a map that grows promises an rms, a max_error or lossless");
  if (measured && !(map.promise_m > 0 && std::isfinite(map.promise_m)))
    return make_error(ErrorCode::kInvalidArgument, "the promise is a positive number of metres");
  if (!(map.color_error >= 0) || !(map.tile_size_m >= 0) || !std::isfinite(map.tile_size_m))
    return make_error(ErrorCode::kInvalidArgument, "colour error and tile size are numbers of 0 or more");
  if (map.promise_m > 0 && map.tile_size_m > map.promise_m * double(1 << 20))
    return make_error(ErrorCode::kInvalidArgument, "the tiles are too large for the promise");
  return {};
}

CompressOptions options_of(const NewMap& map) {
  CompressOptions o;
  o.promise = map.promise;
  o.promise_m = map.promise_m;
  o.color_error = map.color_error;
  o.tile_size_m = map.tile_size_m;
  if (!map.channels.empty()) {
    o.channels.clear();
    for (const ChannelInfo& c : map.channels) o.channels.push_back(c.name);
  }
  return o;
}

MapInfo info_of(const MapSchema& schema) {
  MapInfo info;
  info.schema = write_schema(schema);
  info.origin = schema.origin;
  info.tile_size_m = schema.tile_size_m;
  return info;
}

}  // namespace

Status UpdaterCoding::create(const std::string& path, const NewMap& map) {
  MAPCODEC_TRY(check_new(map));
  MapSchema schema = schema_without_sample(map);
  if (!map.sample.empty()) {
    CloudSource sample(map.sample);
    std::vector<std::string> ignored;
    MAPCODEC_ASSIGN(schema, schema_for_growth(sample, options_of(map), arena_, path, ignored));
  }
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::create(path, info_of(schema), false));
  writer.store_hashes(true);
  MAPCODEC_TRY(writer.commit(0));
  return {};
}

Result<std::unique_ptr<MapEditor>> UpdaterCoding::edit(const std::string& path,
                                                       const std::atomic<bool>* stop) {
  UpdateSettings settings = settings_;
  settings.stop = stop;
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(path));
  writer.store_hashes(true);
  MAPCODEC_ASSIGN(MapUpdater updater, MapUpdater::over(std::move(writer), arena_, settings));
  return std::unique_ptr<MapEditor>(std::make_unique<UpdaterEditor>(std::move(updater)));
}

Status UpdaterCoding::check(const PointCloud& points, const MapSchema& schema) const {
  PointCloud empty = points.like();
  widen(empty, schema);
  std::uint64_t dropped = 0;
  MAPCODEC_TRY(fit_to_schema(std::move(empty), schema, dropped));
  return {};
}

Result<PointCloud> UpdaterCoding::decode(const std::vector<ByteSpan>& segments, const MapSchema& schema,
                                         std::optional<unsigned> level, const DecodeLimits& limits) const {
  std::vector<Bytes> copies;
  for (const ByteSpan s : segments) copies.emplace_back(s.begin(), s.end());
  const Bytes joined = join_segments(copies);
  return level ? decode_tile_coarsely(joined, schema, *level, limits) : decode_tile(joined, schema, limits);
}

Result<std::uint64_t> UpdaterCoding::bytes_of_level(ByteSpan base, const MapSchema& schema,
                                                    unsigned level) const {
  MAPCODEC_ASSIGN(const std::vector<std::uint64_t> levels, tile_level_bytes(base, schema));
  return levels.empty() ? base.size() : levels[std::min<std::size_t>(level, levels.size() - 1)];
}

}  // namespace mapcodec
