// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/updater_state.hpp"

#include <algorithm>

#include "slam_adapter/fold_tiles.hpp"
#include "slam_adapter/split_tile.hpp"

namespace mapcodec {

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
  note_neighbors(all, {});
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

Status MapUpdater::State::fold_some(const std::vector<TilePlace>& places) {
  std::vector<FoldTask> tasks;
  for (const TilePlace& p : places) {
    const TileRecord& record = *writer.find(p.key, p.submap);
    MAPCODEC_ASSIGN(std::vector<Bytes> segments, read_all(record));
    tasks.push_back({std::move(segments), record.errors, record.bounds, borders_of(p)});
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
  cache.forget(place);
  rms.fold(double(f.coded_points), f.forward_m, f.backward_m);
  if (f.points == 0) return writer.remove(place.key, place.submap);
  return writer.add(place.key, f.codec, f.points, f.bounds, f.errors, f.bytes, place.submap);
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
  cache.forget(place);
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

}  // namespace mapcodec
