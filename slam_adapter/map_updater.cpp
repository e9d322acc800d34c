// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/map_updater.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "parallel/guard.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/fold_tiles.hpp"
#include "slam_adapter/level_errors.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"
#include "slam_adapter/point_batch.hpp"
#include "slam_adapter/rms_account.hpp"
#include "slam_adapter/split_tile.hpp"
#include "slam_adapter/tile_directory.hpp"
#include "slam_adapter/tile_work.hpp"

namespace mapcodec {
namespace {

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

// Stored points that are looked at together: fewer leave threads without work, more take memory.
constexpr std::uint64_t kPointsTogether = 8000000;

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
  struct Held {
    std::uint32_t submap = 0;
    ScanPart part;
  };
  std::vector<Held> held;
  std::uint64_t scan = 0;  // number of the one that comes
  std::uint64_t held_points = 0;
  struct Known {
    std::shared_ptr<StoredPoints> points;
    std::uint64_t used = 0;
  };
  std::map<TilePlace, Known, TilePlaceLess> cache;
  std::uint64_t clock = 0;
  UpdateReport report;
  TileErrors achieved;  // of the map, what came in since the last commit included
  RmsAccount rms;
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
  using Batch = std::map<TilePlace, std::vector<ScanPart>, TilePlaceLess>;
  Batch take_some(Batch& tiles) const;
  Status flush_some(Batch tiles);
  void sort_into_tiles(Batch& tiles, const Held& held);
  TileDirectory& directory(std::uint32_t submap);
  Result<std::vector<Bytes>> read_all(const TileRecord& record) const;
  Result<TileWork> prepare(const TilePlace& place);
  Status look_up_all(std::vector<TileWork>& work, const Batch& generous);
  Status store(TileWork& w);
  void account(const TileWork& w);
  void trim_cache();
  Status run_all(std::size_t count, const std::function<Status(std::size_t)>& body);
  Status erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap);
  Status erase_in(const TileRecord& record, const Erasure& e);
  Result<Erasure> in_submap(const Erasure& e, std::uint32_t submap) const;
  Status fold(std::size_t least);
  Status fold_some(const std::vector<TilePlace>& places);
  Status replace(const TilePlace& place, const Fold& f);
  Status split_large(std::vector<TilePlace> places);
  Result<std::vector<TilePlace>> split_one(const TilePlace& place);
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
  const bool has_account = schema.promise == PromiseKind::rms;
  rms = RmsAccount(writer.info(), has_account ? schema.promise_value : 0, double(stored_points));
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

void MapUpdater::State::sort_into_tiles(Batch& tiles, const Held& h) {
  const PointCloud& points = h.part.points;
  TileDirectory& tiles_of = directory(h.submap);
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
    std::vector<ScanPart>& scans = tiles[TilePlace{h.submap, key}];
    if (scans.empty() || scans.back().scan != h.part.scan) scans.push_back({h.part.scan, points.like()});
    scans.back().points.append(points.gather(indices));
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

Result<TileWork> MapUpdater::State::prepare(const TilePlace& place) {
  TileWork w;
  w.place = place;
  const TileRecord* record = writer.find(place.key, place.submap);
  w.begins = record == nullptr;
  w.cap = settings.density_cap;
  w.allowed_rms_m = schema.promise_value;
  if (!settings.density_cap || record == nullptr) return w;
  // A tile may have more than the map on the whole, and then its own points coming again are no news.
  w.allowed_rms_m = std::max(w.allowed_rms_m, record->errors.rms_m);
  const auto known = cache.find(place);
  if (known != cache.end()) {
    w.stored = known->second.points;
  } else {
    MAPCODEC_ASSIGN(w.segments, read_all(*record));
  }
  return w;
}

/// @param generous  scans of tiles that may have more than the promise: where the map on the whole would not
/// keep it, they are looked at again, with so much less.
Status MapUpdater::State::look_up_all(std::vector<TileWork>& work, const Batch& generous) {
  const auto look = [&](std::size_t i) { return look_up(work[i], schema, coding); };
  MAPCODEC_TRY(run_all(work.size(), look));
  const double limit = schema.promise_value * schema.promise_value;
  double known = 0, known_m2 = 0, beyond_m2 = 0;
  for (const TileWork& w : work) {
    known += w.known;
    known_m2 += w.known_m2;
    beyond_m2 += std::max(0.0, w.known_m2 - limit * w.known);
  }
  const double excess_m2 = generous.empty() ? 0 : rms.excess_m2(known, known_m2);
  if (!(excess_m2 > 0)) return {};
  const double left = std::max(0.0, 1 - excess_m2 / std::max(beyond_m2, excess_m2));
  for (TileWork& w : work) {
    const auto scans = generous.find(w.place);
    if (scans == generous.end() || w.known_m2 <= limit * w.known) continue;
    const double mean_m2 = w.known_m2 / w.known;
    cache.erase(w.place);
    MAPCODEC_ASSIGN(w, prepare(w.place));
    w.allowed_rms_m = std::sqrt(limit + left * (mean_m2 - limit));
    w.scans = scans->second;
  }
  return run_all(work.size(), look);
}

Status MapUpdater::State::store(TileWork& w) {
  account(w);
  if (w.stored != nullptr) cache[w.place] = {w.stored, clock};
  if (!w.coded) return {};
  changed = true;
  const TileRecord* record = writer.find(w.place.key, w.place.submap);
  const double before = record == nullptr ? 0 : double(record->points);
  const TileErrors old = record == nullptr ? TileErrors{} : record->errors;
  const TileErrors errors = joint_errors(old, before, before, w, farthest_known(schema));
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
  achieved = joint_errors(achieved, double(input_points), double(stored_points), w, farthest_known(schema));
  if (schema.promise == PromiseKind::rms) {
    const EncodedTile none;
    const EncodedTile& t = w.coded ? *w.coded : none;
    rms.add({w.added_points, w.known, w.known_m2, t.rms_forward_m, t.rms_backward_m, is_pending(t.bytes)});
    achieved.rms_m = rms.rms_m();
  }
  const auto added = static_cast<std::uint64_t>(w.added_points), known = static_cast<std::uint64_t>(w.known);
  input_points += added + known;
  stored_points += added;
  report.points_added += added;
  report.points_known += known;
}

void MapUpdater::State::trim_cache() {
  std::uint64_t bytes = 0;
  std::vector<std::pair<std::uint64_t, TilePlace>> by_age;
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

/// Moves the first tiles out, as many as are looked at together: what is stored of them is decoded for that.
MapUpdater::State::Batch MapUpdater::State::take_some(Batch& tiles) const {
  Batch some;
  std::uint64_t points = 0;
  while (!tiles.empty()) {
    const TilePlace& place = tiles.begin()->first;
    const TileRecord* record = writer.find(place.key, place.submap);
    points += record == nullptr ? 0 : record->points;
    if (!some.empty() && points > kPointsTogether) break;
    some.insert(tiles.extract(tiles.begin()));
  }
  return some;
}

Status MapUpdater::State::flush() {
  Batch tiles;
  for (const Held& h : held) sort_into_tiles(tiles, h);
  held.clear();
  held_points = 0;
  ++clock;
  while (!tiles.empty()) MAPCODEC_TRY(flush_some(take_some(tiles)));
  return stopped();
}

Status MapUpdater::State::flush_some(Batch tiles) {
  std::vector<TileWork> work;
  Batch generous;
  for (auto& [place, scans] : tiles) {
    MAPCODEC_ASSIGN(TileWork w, prepare(place));
    if (w.allowed_rms_m > schema.promise_value) generous[place] = scans;
    w.scans = std::move(scans);
    work.push_back(std::move(w));
  }
  MAPCODEC_TRY(stopped());
  MAPCODEC_TRY(look_up_all(work, generous));
  MAPCODEC_TRY(run_all(
      work.size(), [&](std::size_t i) { return code_added(work[i], schema, coding, settings.for_good); }));
  std::vector<TilePlace> touched;
  for (TileWork& w : work) {
    MAPCODEC_TRY(store(w));
    touched.push_back(w.place);
  }
  work.clear();
  MAPCODEC_TRY(split_large(std::move(touched)));
  trim_cache();
  return {};
}

/// Tiles that grew far beyond the others, and then their parts.
Status MapUpdater::State::split_large(std::vector<TilePlace> places) {
  while (!places.empty()) {
    const TilePlace place = places.back();
    places.pop_back();
    const TileRecord* record = writer.find(place.key, place.submap);
    if (record == nullptr || record->points <= settings.split_points || place.key.level == 0) continue;
    MAPCODEC_TRY(stopped());
    MAPCODEC_ASSIGN(const std::vector<TilePlace> parts, split_one(place));
    places.insert(places.end(), parts.begin(), parts.end());
  }
  return {};
}

Result<std::vector<TilePlace>> MapUpdater::State::split_one(const TilePlace& place) {
  const TileRecord record = *writer.find(place.key, place.submap);
  MAPCODEC_ASSIGN(const std::vector<Bytes> segments, read_all(record));
  MAPCODEC_ASSIGN(const auto parts, split_tile(place.key, segments, schema, coding, record.errors));
  std::vector<TilePlace> places;
  if (!parts) return places;
  cache.erase(place);
  ++report.tiles_split;
  MAPCODEC_TRY(writer.remove(place.key, place.submap));
  TileDirectory& tiles_of = directory(place.submap);
  tiles_of.split(place.key);
  for (const TilePart& part : *parts) {
    tiles_of.add(part.key);
    report.bytes += part.tile.bytes.size();
    rms.fold(double(part.tile.coded_points), part.tile.forward_m, part.tile.backward_m);
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

Status MapUpdater::State::fold_some(const std::vector<TilePlace>& places) {
  std::vector<FoldTask> tasks;
  for (const TilePlace& p : places) {
    const TileRecord& record = *writer.find(p.key, p.submap);
    MAPCODEC_ASSIGN(std::vector<Bytes> segments, read_all(record));
    tasks.push_back({std::move(segments), record.errors, record.bounds});
  }
  const RunEach run = [this](std::size_t count, const std::function<Status(std::size_t)>& body) {
    return run_all(count, body);
  };
  MAPCODEC_ASSIGN(const auto folds, fold_tiles(tasks, schema, rms.folding_rms_m(), run));
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (folds[i]) MAPCODEC_TRY(replace(places[i], *folds[i]));
  }
  return stopped();
}

Status MapUpdater::State::replace(const TilePlace& place, const Fold& f) {
  changed = true;
  ++report.tiles_folded;
  report.bytes += f.bytes.size();
  cache.erase(place);
  rms.fold(double(f.coded_points), f.forward_m, f.backward_m);
  if (f.points == 0) return writer.remove(place.key, place.submap);
  return writer.add(place.key, f.codec, f.points, f.bounds, f.errors, f.bytes, place.submap);
}

Status MapUpdater::State::fold(std::size_t least) {
  std::vector<TilePlace> places;
  std::uint64_t together = 0;
  const auto fold_them = [&]() -> Status {
    together = 0;
    return places.empty() ? Status{} : fold_some(std::exchange(places, {}));
  };
  std::vector<TilePlace> all;
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap != octree && t->segments.size() >= least) all.push_back({t->submap, t->key});
  }
  // So many at once share the promise; never by the number of threads, which must not change the bytes.
  for (const TilePlace& p : all) {
    const std::uint64_t points = writer.find(p.key, p.submap)->points;
    if (together + points > settings.batch_points) MAPCODEC_TRY(fold_them());
    places.push_back(p);
    together += points;
  }
  MAPCODEC_TRY(fold_them());
  if (least <= 1) rms.all_folded();
  if (report.tiles_folded == 0) return {};
  double points = 0, color = 0;
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap == octree) continue;
    points += double(t->points);
    color += double(t->points) * t->errors.color_error;
    achieved.max_axis_error_m = std::max(achieved.max_axis_error_m, t->errors.max_axis_error_m);
  }
  if (points > 0) achieved.color_error = std::max(achieved.color_error, color / points);
  if (schema.promise == PromiseKind::rms) achieved.rms_m = rms.rms_m();
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

Result<MapUpdater> MapUpdater::over(MapWriter writer, Arena& arena, const UpdateSettings& settings,
                                    bool changed) {
  auto state = std::make_unique<State>(std::move(writer), arena, settings);
  state->changed = changed;
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
  MAPCODEC_TRY(check_octree_pose(state_->writer.info(), poses));
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

Status MapUpdater::insert(PointCloud points, std::uint32_t submap, ScanEnd end) {
  State& s = *state_;
  MAPCODEC_TRY(s.holds_points());
  MAPCODEC_TRY(check_holds_points(s.writer.info(), submap));
  std::uint64_t dropped = 0;
  MAPCODEC_ASSIGN(PointCloud fitted, fit_to_schema(std::move(points), s.schema, dropped));
  s.report.dropped_points += dropped;
  s.report.points_in += fitted.size();
  s.held_points += fitted.size();
  if (!fitted.empty()) s.held.push_back({submap, {s.scan, std::move(fitted)}});
  if (end == ScanEnd::here) ++s.scan;
  return s.held_points >= s.settings.batch_points ? flush() : Status{};
}

void MapUpdater::end_scan() {
  ++state_->scan;
}

Status MapUpdater::State::erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap) {
  std::vector<TilePlace> places;
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap != octree && (!submap || t->submap == *submap)) places.push_back({t->submap, t->key});
  }
  for (const TilePlace& p : places) {
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
  info.extras.erase(kRmsAccountExtra);
  if (auto account = s.rms.extra()) info.extras[kRmsAccountExtra] = *std::move(account);
  for (auto& [name, value] : s.extras) info.extras[name] = std::move(value);
  s.extras.clear();
  MAPCODEC_TRY(s.writer.set_info(std::move(info)));
  MAPCODEC_ASSIGN(report.revision, s.writer.commit(timestamp_s));
  report.committed = true;
  s.changed = false;
  return report;
}

}  // namespace mapcodec
