// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/updater_state.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

// Stored points that are looked at together: fewer leave threads without work, more take memory.
constexpr std::uint64_t kPointsTogether = 8000000;

}  // namespace

Status MapUpdater::State::flush() {
  Batch tiles;
  for (const Held& h : held) sort_into_tiles(tiles, h);
  held.clear();
  held_points = 0;
  cache.next_batch();
  if (settings.for_good) {
    std::vector<TilePlace> places;
    for (const auto& [place, scans] : tiles) places.push_back(place);
    note_neighbors(places, places);
  }
  while (!tiles.empty()) MAPCODEC_TRY(flush_some(take_some(tiles)));
  return stopped();
}

Status MapUpdater::State::flush_some(Batch tiles) {
  std::vector<TileWork> work;
  Batch generous;
  for (auto& [place, scans] : tiles) {
    MAPCODEC_ASSIGN(TileWork w, prepare(place));
    const auto by_chance = [&](const ScanPart& part) { return is_by_chance(w, part); };
    if (w.allowed_rms_m > schema.promise_value || std::any_of(scans.begin(), scans.end(), by_chance))
      generous[place] = scans;
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
  cache.trim(settings.cache_bytes);
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

Result<TileWork> MapUpdater::State::prepare(const TilePlace& place) {
  TileWork w;
  w.place = place;
  const TileRecord* record = writer.find(place.key, place.submap);
  w.begins = record == nullptr;
  w.cap = settings.density_cap;
  if (settings.for_good && w.begins) w.borders = borders_of(place);
  w.allowed_rms_m = schema.promise_value;
  w.by_chance = settings.density_cap && schema.promise == PromiseKind::rms;
  if (!settings.density_cap || record == nullptr) return w;
  // A tile may have more than the map on the whole, and then its own points coming again are no news.
  w.allowed_rms_m = std::max(w.allowed_rms_m, record->errors.rms_m);
  w.stored = cache.find(place);
  if (w.stored == nullptr) {
    MAPCODEC_ASSIGN(w.segments, read_all(*record));
  }
  return w;
}

/// @param generous  scans of tiles whose points may have more than the promise: where the map on the whole
/// would not keep it, they are looked at again, with so much less.
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
    cache.forget(w.place);
    MAPCODEC_ASSIGN(w, prepare(w.place));
    w.by_chance = false;
    w.allowed_rms_m = std::sqrt(limit + left * (mean_m2 - limit));
    w.scans = scans->second;
  }
  return run_all(work.size(), look);
}

Status MapUpdater::State::store(TileWork& w) {
  account(w);
  if (w.stored != nullptr) cache.keep(w.place, w.stored);
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

}  // namespace mapcodec
