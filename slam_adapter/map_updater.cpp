// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/map_updater.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "mapcodec/quality/novelty.hpp"
#include "parallel/guard.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/fold_tile.hpp"
#include "slam_adapter/level_errors.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"
#include "slam_adapter/point_batch.hpp"
#include "slam_adapter/split_tile.hpp"
#include "slam_adapter/tile_directory.hpp"

namespace mapcodec {
namespace {

/// A tile of a submap.
struct Place {
  std::uint32_t submap = 0;
  TileKey key;
};
struct PlaceLess {
  bool operator()(const Place& a, const Place& b) const {
    return compare_tiles(a.submap, a.key, b.submap, b.key) < 0;
  }
};

/// One tile while a batch is coded.
struct TileWork {
  Place place;
  PointCloud points;                     ///< that came in
  std::shared_ptr<StoredPoints> stored;  ///< known already, or made here
  std::vector<Bytes> segments;           ///< where it is not known
  bool begins = false;                   ///< the tile had nothing before
  double allowed_rms_m = 0;              ///< that points may have to what stands for them
  Novelty novelty;
  std::optional<EncodedTile> coded;  ///< of what is new
  Status status;
};

/// Weighted mean of two figures.
double mean_of(double a, double weight_a, double b, double weight_b) {
  return weight_a + weight_b > 0 ? (a * weight_a + b * weight_b) / (weight_a + weight_b) : 0;
}

double root_mean(double a, double weight_a, double sum_b, double weight_b) {
  return weight_a + weight_b > 0 ? std::sqrt((a * a * weight_a + sum_b) / (weight_a + weight_b)) : 0;
}

/// What joins old points and new ones, those that only stand for others included.
/// @param old_points  that came in. @param old_stored  that are stored: the other direction of the RMS is
/// theirs.
TileErrors joint(const TileErrors& old, double old_points, double old_stored, const TileWork& w,
                 double farthest_m) {
  const double known = double(w.points.size() - w.novelty.added.size());
  const TileErrors add = w.coded ? w.coded->errors : TileErrors{};
  const double added = double(w.novelty.added.size());
  TileErrors e;
  const double squares = added * add.rms_m * add.rms_m;
  const double forward = root_mean(old.rms_m, old_points, w.novelty.squared_m2 + squares, known + added);
  e.rms_m = std::max(forward, root_mean(old.rms_m, old_stored, squares, added));
  e.max_axis_error_m = std::max({old.max_axis_error_m, add.max_axis_error_m, known > 0 ? farthest_m : 0});
  e.color_error = mean_of(old.color_error, old_points, add.color_error, added);
  e.density_error = mean_of(old.density_error, old_points, add.density_error, added);
  return e;
}

/// The level that most points have.
std::uint8_t usual_level(const std::vector<const TileRecord*>& tiles) {
  std::map<std::uint8_t, std::uint64_t> points;
  for (const TileRecord* t : tiles) {
    if (!t->key.is_unplaced()) points[t->key.level] += t->points;
  }
  const auto most = std::max_element(points.begin(), points.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == points.end() ? 0 : most->first;
}

/// All points of a tile, those first that no folding will move.
Status add_segments(StoredPoints& stored, const std::vector<Bytes>& segments, const MapSchema& schema) {
  const Bytes joined = join_segments(segments);
  MAPCODEC_ASSIGN(const std::vector<ByteSpan> all, split_segments(joined));
  PointCloud parts[2] = {schema.layout(), schema.layout()};
  for (const ByteSpan s : all) {
    if (is_erasure(s)) {
      MAPCODEC_ASSIGN(const Erasure e, read_erasure(s));
      for (PointCloud& part : parts) MAPCODEC_TRY(erase_points(part, e));
      continue;
    }
    MAPCODEC_ASSIGN(const PointCloud cloud, decode_tile(s, schema));
    parts[is_pending(s)].append(cloud);
  }
  stored.add(parts[0], false);
  stored.add(parts[1], true);
  return {};
}

}  // namespace

struct MapUpdater::State {
  State(MapWriter w, Arena& a, const UpdateSettings& s) : writer(std::move(w)), arena(a), settings(s) {}

  MapWriter writer;
  Arena& arena;
  UpdateSettings settings;
  MapSchema schema;
  PendingCoding coding;
  std::uint8_t new_level = 0;
  std::optional<std::uint32_t> octree;  ///< submap whose tiles are no points
  std::map<std::uint32_t, TileDirectory> directories;
  std::vector<std::pair<std::uint32_t, PointCloud>> held;
  std::uint64_t held_points = 0;
  struct Known {
    std::shared_ptr<StoredPoints> points;
    std::uint64_t used = 0;
  };
  std::map<Place, Known, PlaceLess> cache;
  std::uint64_t clock = 0;
  UpdateReport report;
  TileErrors achieved;  // of the map, what came in since the last commit included
  std::uint64_t input_points = 0, stored_points = 0, input_bytes = 0;
  bool changed = false;
  std::map<std::string, Bytes> extras;  // of the next revision
  Status failed;  // the first error that came half way: from then on nothing is committed

  Status begin();
  Status remember(Status s) {
    if (!s.ok() && failed.ok()) failed = s;
    return s;
  }
  Status flush();
  void sort_into_tiles(std::map<Place, PointCloud, PlaceLess>& tiles, std::uint32_t submap,
                       const PointCloud&);
  TileDirectory& directory(std::uint32_t submap);
  Result<std::vector<Bytes>> read_all(const TileRecord& record) const;
  Result<TileWork> prepare(const Place& place, PointCloud points);
  Status work_on(TileWork& w) const;
  Status look_up(TileWork& w) const;
  Status store(TileWork& w);
  void account(const TileWork& w);
  void trim_cache();
  Status run_all(std::size_t count, const std::function<Status(std::size_t)>& body);
  Status erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap);
  Status erase_in(const TileRecord& record, const Erasure& e);
  Result<Erasure> in_submap(const Erasure& e, std::uint32_t submap) const;
  Status fold(std::size_t least);
  Status fold_some(const std::vector<Place>& places);
  Status split_large(std::vector<Place> places);
  Result<std::vector<Place>> split_one(const Place& place);
  Status holds_points() const {
    if (!schema.occupancy) return {};
    return make_error(
        ErrorCode::kUnsupported,
        "is a map of an octree: its leaves change by an update with a .bt or .ot, not point by point");
  }
  Status stopped() const {
    return settings.stop != nullptr && *settings.stop ? Status(make_error(ErrorCode::kCancelled, "stopped"))
                                                      : Status{};
  }
};

Status MapUpdater::State::begin() {
  MAPCODEC_ASSIGN(schema, read_schema(writer.info().schema));
  MAPCODEC_ASSIGN(coding, pending_coding(schema, settings.effort));
  achieved = writer.info().achieved;
  input_points = writer.info().input_points;
  input_bytes = writer.info().input_bytes;
  const auto level = writer.info().extras.find(kNewTileLevelExtra);
  const bool has_level = level != writer.info().extras.end() && level->second.size() == 1;
  new_level = has_level ? std::min(level->second[0], kMaxTileLevel) : usual_level(writer.tiles());
  octree = octree_submap(writer.info());
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap == octree) continue;
    directory(t->submap).add(t->key);
    stored_points += t->points;
  }
  return {};
}

TileDirectory& MapUpdater::State::directory(std::uint32_t submap) {
  return directories.try_emplace(submap, schema.origin, schema.tile_size_m, new_level).first->second;
}

Status MapUpdater::State::run_all(std::size_t count, const std::function<Status(std::size_t)>& body) {
  std::vector<Status> done(count);
  TbbRunner runner(arena);
  runner.run(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      done[i] = parallel_detail::guarded("update", [&] { return body(i); });
  });
  for (const Status& s : done) MAPCODEC_TRY(s);
  return {};
}

void MapUpdater::State::sort_into_tiles(std::map<Place, PointCloud, PlaceLess>& tiles, std::uint32_t submap,
                                        const PointCloud& points) {
  TileDirectory& tiles_of = directory(submap);
  std::map<TileKey, std::vector<std::uint32_t>, MortonLess> members;
  const TileKey* last = nullptr;
  std::vector<std::uint32_t>* list = nullptr;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const auto key = tiles_of.place(points.xyz[i]);
    if (!key) {
      ++report.dropped_points;  // beyond what tile numbers can say
      continue;
    }
    if (last == nullptr || !(*last == *key)) {
      const auto at = members.try_emplace(*key).first;
      last = &at->first;
      list = &at->second;
    }
    list->push_back(i);
  }
  for (const auto& [key, indices] : members) {
    PointCloud part = points.gather(indices);
    const auto [at, is_new] = tiles.try_emplace(Place{submap, key}, std::move(part));
    if (!is_new) at->second.append(part);
  }
}

Result<std::vector<Bytes>> MapUpdater::State::read_all(const TileRecord& record) const {
  std::vector<Bytes> all;
  for (const SegmentRef& s : record.segments) {
    MAPCODEC_ASSIGN(Bytes bytes, writer.read(s));
    all.push_back(std::move(bytes));
  }
  return all;
}

Result<TileWork> MapUpdater::State::prepare(const Place& place, PointCloud points) {
  TileWork w;
  w.place = place;
  w.points = std::move(points);
  const TileRecord* record = writer.find(place.key, place.submap);
  w.begins = record == nullptr;
  w.allowed_rms_m = schema.promise_value;
  if (!settings.density_cap || record == nullptr) return w;
  // A tile may have more than the map on the whole, and then its own points coming again are no news.
  if (achieved.rms_m < 0.999 * schema.promise_value)
    w.allowed_rms_m = std::max(w.allowed_rms_m, record->errors.rms_m);
  const auto known = cache.find(place);
  if (known != cache.end()) {
    w.stored = known->second.points;
  } else {
    MAPCODEC_ASSIGN(w.segments, read_all(*record));
  }
  return w;
}

Status MapUpdater::State::look_up(TileWork& w) const {
  if (w.stored == nullptr && !w.segments.empty()) {
    const Box cube = w.place.key.is_unplaced() ? Box{{0, 0, 0}, {0, 0, 0}}
                                               : tile_cube(w.place.key, schema.origin, schema.tile_size_m);
    w.stored = make_stored_points(schema, cube.min);
    MAPCODEC_TRY(add_segments(*w.stored, w.segments, schema));
    w.segments.clear();
  }
  if (w.stored == nullptr) {
    w.novelty.added.resize(w.points.size());
    for (std::uint32_t i = 0; i < w.points.size(); ++i) w.novelty.added[i] = i;
  } else {
    const bool with_channels = schema.promise == PromiseKind::lossless;
    w.novelty = with_channels ? w.stored->look(without_dropped(w.points, schema), w.allowed_rms_m)
                              : w.stored->look(w.points, w.allowed_rms_m);
  }
  return {};
}

Status MapUpdater::State::work_on(TileWork& w) const {
  MAPCODEC_TRY(look_up(w));
  if (w.novelty.added.empty()) return {};
  const bool all = w.novelty.added.size() == w.points.size();
  const PointCloud some = all ? PointCloud{} : w.points.gather(w.novelty.added);
  if (settings.for_good && w.begins) {
    MAPCODEC_ASSIGN(w.coded, encode_for_good(w.points, schema, false));
    return {};
  }
  const PointCloud& added = all ? w.points : some;
  MAPCODEC_ASSIGN(EncodedTile t, encode_tile(added, coding.schema, coding.tiles));
  if (w.stored != nullptr) w.stored->add(as_decoded(added, schema, coding), true);
  mark_pending(t.bytes);
  w.coded = std::move(t);
  return {};
}

Status MapUpdater::State::store(TileWork& w) {
  account(w);
  if (w.stored != nullptr) cache[w.place] = {w.stored, clock};
  if (!w.coded) return {};
  changed = true;
  const TileRecord* record = writer.find(w.place.key, w.place.submap);
  const double before = record == nullptr ? 0 : double(record->points);
  const TileErrors old = record == nullptr ? TileErrors{} : record->errors;
  const TileErrors errors = joint(old, before, before, w, farthest_known(schema));
  report.bytes += w.coded->bytes.size();
  ++report.tiles_touched;
  if (record == nullptr) {
    ++report.tiles_new;
    return writer.add(w.place.key, static_cast<std::uint8_t>(w.coded->codec), w.coded->points,
                      w.coded->bounds, errors, w.coded->bytes, w.place.submap);
  }
  Box bounds = record->bounds;
  bounds.add(w.coded->bounds);
  return writer.extend(w.place.key, record->points + w.coded->points, bounds, errors, w.coded->bytes,
                       w.place.submap);
}

/// The map's figures follow those of its points.
void MapUpdater::State::account(const TileWork& w) {
  achieved = joint(achieved, double(input_points), double(stored_points), w, farthest_known(schema));
  input_points += w.points.size();
  stored_points += w.novelty.added.size();
  report.points_added += w.novelty.added.size();
  report.points_known += w.points.size() - w.novelty.added.size();
}

void MapUpdater::State::trim_cache() {
  std::uint64_t bytes = 0;
  std::vector<std::pair<std::uint64_t, Place>> by_age;
  for (const auto& [place, known] : cache) {
    bytes += known.points->bytes();
    by_age.emplace_back(known.used, place);
  }
  if (bytes <= settings.cache_bytes) return;
  std::stable_sort(by_age.begin(), by_age.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [used, place] : by_age) {
    if (bytes <= settings.cache_bytes) break;
    const auto at = cache.find(place);
    bytes -= at->second.points->bytes();
    cache.erase(at);
  }
}

Status MapUpdater::State::flush() {
  std::map<Place, PointCloud, PlaceLess> tiles;
  for (const auto& [submap, points] : held) sort_into_tiles(tiles, submap, points);
  held.clear();
  held_points = 0;
  ++clock;
  std::vector<TileWork> work;
  for (auto& [place, points] : tiles) {
    MAPCODEC_ASSIGN(TileWork w, prepare(place, std::move(points)));
    work.push_back(std::move(w));
  }
  MAPCODEC_TRY(stopped());
  MAPCODEC_TRY(run_all(work.size(), [&](std::size_t i) { return work_on(work[i]); }));
  std::vector<Place> touched;
  for (TileWork& w : work) {
    MAPCODEC_TRY(store(w));
    touched.push_back(w.place);
  }
  MAPCODEC_TRY(split_large(std::move(touched)));
  trim_cache();
  return stopped();
}

/// Tiles that grew far beyond the others, and then their parts.
Status MapUpdater::State::split_large(std::vector<Place> places) {
  while (!places.empty()) {
    const Place place = places.back();
    places.pop_back();
    const TileRecord* record = writer.find(place.key, place.submap);
    if (record == nullptr || record->points <= settings.split_points || place.key.level == 0) continue;
    MAPCODEC_TRY(stopped());
    MAPCODEC_ASSIGN(const std::vector<Place> parts, split_one(place));
    places.insert(places.end(), parts.begin(), parts.end());
  }
  return {};
}

Result<std::vector<Place>> MapUpdater::State::split_one(const Place& place) {
  const TileRecord record = *writer.find(place.key, place.submap);
  MAPCODEC_ASSIGN(const std::vector<Bytes> segments, read_all(record));
  MAPCODEC_ASSIGN(const auto parts, split_tile(place.key, segments, schema, coding, record.errors));
  std::vector<Place> places;
  if (!parts) return places;
  cache.erase(place);
  ++report.tiles_split;
  MAPCODEC_TRY(writer.remove(place.key, place.submap));
  TileDirectory& tiles_of = directory(place.submap);
  tiles_of.split(place.key);
  for (const TilePart& part : *parts) {
    tiles_of.add(part.key);
    report.bytes += part.tile.bytes.size();
    places.push_back({place.submap, part.key});
    MAPCODEC_TRY(writer.add(part.key, part.tile.codec, part.tile.points, part.tile.bounds, part.tile.errors,
                            part.tile.bytes, place.submap));
  }
  return places;
}

Result<Erasure> MapUpdater::State::in_submap(const Erasure& e, std::uint32_t submap) const {
  const RigidMotion pose = pose_of(writer.info(), submap);
  Erasure moved = e;
  if (pose.is_identity() || (!e.box && !e.sphere)) return moved;
  const Vec3 t = pose.apply(Vec3{0, 0, 0});
  moved.motion.emplace();
  for (std::size_t column = 0; column < 3; ++column) {
    Vec3 axis{0, 0, 0};
    axis[column] = 1;
    const Vec3 r = pose.rotate(axis);
    for (std::size_t row = 0; row < 3; ++row) (*moved.motion)[3 * row + column] = r[row];
  }
  for (std::size_t d = 0; d < 3; ++d) (*moved.motion)[9 + d] = t[d];
  return moved;
}

Status MapUpdater::State::erase_in(const TileRecord& tile, const Erasure& e) {
  const TileRecord record = tile;  // the writer's own changes below
  MAPCODEC_ASSIGN(const std::vector<Bytes> segments, read_all(record));
  MAPCODEC_ASSIGN(PointCloud cloud, decode_tile(join_segments(segments), schema));
  const std::size_t before = cloud.size();
  MAPCODEC_TRY(erase_points(cloud, e));
  if (cloud.size() == before) return {};
  changed = true;
  cache.erase({record.submap, record.key});
  if (cloud.empty()) {
    ++report.tiles_removed;
    return writer.remove(record.key, record.submap);
  }
  ++report.tiles_touched;
  const Bytes payload = write_erasure(e);
  report.bytes += payload.size();
  return writer.extend(record.key, cloud.size(), record.bounds, record.errors, payload, record.submap);
}

Status MapUpdater::State::fold_some(const std::vector<Place>& places) {
  std::vector<std::vector<Bytes>> segments;
  for (const Place& p : places) {
    MAPCODEC_ASSIGN(std::vector<Bytes> all, read_all(*writer.find(p.key, p.submap)));
    segments.push_back(std::move(all));
  }
  std::vector<std::optional<Fold>> folds(places.size());
  MAPCODEC_TRY(run_all(places.size(), [&](std::size_t i) -> Status {
    const TileRecord& record = *writer.find(places[i].key, places[i].submap);
    MAPCODEC_ASSIGN(folds[i], fold_tile(segments[i], schema, record.errors, record.bounds));
    return {};
  }));
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!folds[i]) continue;
    const Fold& f = *folds[i];
    changed = true;
    ++report.tiles_folded;
    report.bytes += f.bytes.size();
    cache.erase(places[i]);
    MAPCODEC_TRY(f.points == 0 ? writer.remove(places[i].key, places[i].submap)
                               : writer.add(places[i].key, f.codec, f.points, f.bounds, f.errors, f.bytes,
                                            places[i].submap));
  }
  return stopped();
}

Status MapUpdater::State::fold(std::size_t least) {
  std::vector<Place> places;
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap != octree && t->segments.size() >= least) places.push_back({t->submap, t->key});
  }
  const std::size_t at_once = 4 * std::size_t(arena.threads());
  for (std::size_t i = 0; i < places.size(); i += at_once) {
    const auto begin = places.begin() + static_cast<std::ptrdiff_t>(i);
    const auto end = places.begin() + static_cast<std::ptrdiff_t>(std::min(places.size(), i + at_once));
    MAPCODEC_TRY(fold_some({begin, end}));
  }
  if (report.tiles_folded == 0) return {};
  double points = 0, squares = 0, color = 0;
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap == octree) continue;
    points += double(t->points);
    squares += double(t->points) * t->errors.rms_m * t->errors.rms_m;
    color += double(t->points) * t->errors.color_error;
    achieved.max_axis_error_m = std::max(achieved.max_axis_error_m, t->errors.max_axis_error_m);
  }
  if (points > 0) {
    achieved.rms_m = std::max(achieved.rms_m, std::sqrt(squares / points));
    achieved.color_error = std::max(achieved.color_error, color / points);
  }
  return {};
}

MapUpdater::MapUpdater(std::unique_ptr<State> state) : state_(std::move(state)) {}
MapUpdater::MapUpdater(MapUpdater&&) noexcept = default;
MapUpdater& MapUpdater::operator=(MapUpdater&&) noexcept = default;
MapUpdater::~MapUpdater() = default;

Result<MapUpdater> MapUpdater::open(const std::string& path, Arena& arena, const UpdateSettings& settings) {
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(path));
  return over(std::move(writer), arena, settings);
}

Result<MapUpdater> MapUpdater::over(MapWriter writer, Arena& arena, const UpdateSettings& settings) {
  auto state = std::make_unique<State>(std::move(writer), arena, settings);
  MAPCODEC_TRY(state->begin());
  return MapUpdater(std::move(state));
}

const MapSchema& MapUpdater::schema() const {
  return state_->schema;
}
const MapInfo& MapUpdater::info() const {
  return state_->writer.info();
}
std::uint64_t MapUpdater::revision() const {
  return state_->writer.revision();
}

Result<std::uint32_t> MapUpdater::submap(const std::string& name, const std::optional<PoseChange>& pose) {
  if (name.empty() || name.size() > 255)
    return make_error(ErrorCode::kInvalidArgument, "the name of a submap has 1 to 255 bytes");
  MapInfo info = state_->writer.info();
  if (info.submaps.empty()) info.submaps.emplace_back();  // what the map had before is the first one
  const auto known =
      std::find_if(info.submaps.begin(), info.submaps.end(), [&](const Submap& s) { return s.name == name; });
  const auto number = static_cast<std::uint32_t>(known - info.submaps.begin());
  if (known == info.submaps.end()) {
    if (pose) MAPCODEC_TRY(check_pose(pose->translation_m, pose->rotation_xyzw));
    info.submaps.push_back({name, {0, 0, 0}, {0, 0, 0, 1}, 0, 0});
    MAPCODEC_TRY(state_->writer.set_info(std::move(info)));
    state_->changed = true;
  }
  if (!pose) return number;
  PoseChange change = *pose;
  change.submap = number;
  MAPCODEC_TRY(set_poses(std::span(&change, 1)));
  return number;
}

Status MapUpdater::set_poses(std::span<const PoseChange> poses) {
  MAPCODEC_TRY(state_->writer.set_poses(poses));
  state_->changed = state_->changed || !poses.empty();
  return {};
}

Status MapUpdater::set_stamps(std::uint32_t submap, double first_s, double last_s) {
  MapInfo info = state_->writer.info();
  if (submap >= info.submaps.size())
    return make_error(ErrorCode::kInvalidArgument, "there is no such submap");
  info.submaps[submap].first_stamp_s = first_s;
  info.submaps[submap].last_stamp_s = last_s;
  state_->changed = true;
  return state_->writer.set_info(std::move(info));
}

Status MapUpdater::insert(PointCloud points, std::uint32_t submap) {
  State& s = *state_;
  MAPCODEC_TRY(s.holds_points());
  std::uint64_t dropped = 0;
  MAPCODEC_ASSIGN(PointCloud fitted, fit_to_schema(std::move(points), s.schema, dropped));
  s.report.dropped_points += dropped;
  s.report.points_in += fitted.size();
  s.held_points += fitted.size();
  if (!fitted.empty()) s.held.emplace_back(submap, std::move(fitted));
  return s.held_points >= s.settings.batch_points ? flush() : Status{};
}

Status MapUpdater::State::erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap) {
  std::vector<Place> places;
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap != octree && (!submap || t->submap == *submap)) places.push_back({t->submap, t->key});
  }
  for (const Place& p : places) {
    MAPCODEC_TRY(stopped());
    if (!e) {
      changed = true;
      ++report.tiles_removed;
      cache.erase(p);
      MAPCODEC_TRY(writer.remove(p.key, p.submap));
      continue;
    }
    MAPCODEC_ASSIGN(const Erasure local, in_submap(*e, p.submap));
    const TileRecord* record = writer.find(p.key, p.submap);
    // Only the places that the conditions reach are looked at.
    const Box reach = pose_of(writer.info(), p.submap).apply(record->bounds);
    const bool apart = e->box && !e->inverse && !p.key.is_unplaced() && !reach.intersects(*e->box);
    if (!apart) MAPCODEC_TRY(erase_in(*record, local));
  }
  return {};
}

Status MapUpdater::erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap) {
  MAPCODEC_TRY(state_->holds_points());
  MAPCODEC_TRY(flush());
  return state_->remember(state_->erase(e, submap));
}

void MapUpdater::add_input_bytes(std::uint64_t bytes) {
  state_->input_bytes += bytes;
}

void MapUpdater::set_extra(const std::string& name, Bytes value, bool alone) {
  state_->extras[name] = std::move(value);
  if (alone) state_->changed = true;
}

Status MapUpdater::flush() {
  MAPCODEC_TRY(state_->failed);
  return state_->remember(state_->flush());
}

Status MapUpdater::fold(std::size_t least) {
  MAPCODEC_TRY(flush());
  return state_->remember(state_->fold(least));
}

Result<UpdateReport> MapUpdater::commit(std::int64_t timestamp_s) {
  State& s = *state_;
  MAPCODEC_TRY(flush());
  if (s.settings.fold_after > 0) MAPCODEC_TRY(fold(s.settings.fold_after));
  UpdateReport report = std::exchange(s.report, {});
  report.revision = s.writer.revision();
  if (!s.changed) return report;
  MapInfo info = s.writer.info();
  info.bounds = s.writer.posed_bounds();
  info.dropped_points += report.dropped_points;
  info.achieved = s.achieved;
  info.input_points = s.input_points;
  info.input_bytes = s.input_bytes;
  info.extras.erase(kLevelsExtra);  // measured on what the map was
  if (s.settings.density_cap && report.points_in > 0) info.extras[kDensityCapExtra] = Bytes{1};
  for (auto& [name, value] : s.extras) info.extras[name] = std::move(value);
  s.extras.clear();
  MAPCODEC_TRY(s.writer.set_info(std::move(info)));
  MAPCODEC_ASSIGN(report.revision, s.writer.commit(timestamp_s));
  report.committed = true;
  s.changed = false;
  return report;
}

}  // namespace mapcodec
