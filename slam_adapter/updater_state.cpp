// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/updater_state.hpp"

#include <algorithm>

#include "parallel/guard.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"
#include "slam_adapter/split_tile.hpp"

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

}  // namespace

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

void MapUpdater::State::note_neighbors(const std::vector<TilePlace>& places,
                                       const std::vector<TilePlace>& more) {
  neighbors.clear();
  if (schema.promise != PromiseKind::rms) return;  // no surfaces
  std::map<std::uint32_t, std::vector<TileKey>> keys;
  for (const TilePlace& p : places) keys[p.submap];
  const auto note = [&](std::uint32_t submap, const TileKey& key) {
    if (const auto at = keys.find(submap); at != keys.end()) at->second.push_back(key);
  };
  for (const TileRecord* t : writer.tiles()) note(t->submap, t->key);
  for (const TilePlace& p : more) note(p.submap, p.key);
  for (const auto& [submap, tiles] : keys)
    neighbors.try_emplace(submap, tiles, schema.origin, schema.tile_size_m);
}

TileBorders MapUpdater::State::borders_of(const TilePlace& place) const {
  const auto at = neighbors.find(place.submap);
  return at == neighbors.end() ? TileBorders{} : at->second.borders_of(place.key);
}

Result<std::vector<Bytes>> MapUpdater::State::read_all(const TileRecord& record) const {
  std::vector<Bytes> all;
  for (const SegmentRef& s : record.segments) {
    MAPCODEC_ASSIGN(Bytes bytes, writer.read(s));
    all.push_back(std::move(bytes));
  }
  return all;
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

Status MapUpdater::State::holds_points() const {
  if (!schema.occupancy) return {};
  return make_error(
      ErrorCode::kUnsupported,
      "is a map of an octree: its leaves change by an update with a .bt or .ot, not point by point");
}

}  // namespace mapcodec
