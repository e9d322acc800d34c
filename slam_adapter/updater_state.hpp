// SPDX-License-Identifier: GPL-3.0-or-later
// What an updater holds, shared by the files that insert, erase and fold.
#pragma once

#include <functional>
#include <map>

#include "parallel/tile_neighbors.hpp"
#include "slam_adapter/fold_tile.hpp"
#include "slam_adapter/map_updater.hpp"
#include "slam_adapter/rms_account.hpp"
#include "slam_adapter/stored_cache.hpp"
#include "slam_adapter/tile_directory.hpp"
#include "slam_adapter/tile_work.hpp"

namespace mapcodec {

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
  std::map<std::uint32_t, TileNeighbors> neighbors;  ///< by submap, of what is coded for good at present
  struct Held {
    std::uint32_t submap = 0;
    ScanPart part;
  };
  std::vector<Held> held;
  std::uint64_t scan = 0;  // number of the one that comes
  std::uint64_t held_points = 0;
  StoredCache cache;
  UpdateReport report;
  TileErrors achieved;  // of the map, what came in since the last commit included
  RmsAccount rms;
  std::uint64_t input_points = 0, stored_points = 0, input_bytes = 0;
  bool changed = false;
  std::map<std::string, Bytes> extras;  // of the next revision
  Status failed;  // the first error that came half way: from then on nothing is committed

  // state: what all parts use.
  Status begin();
  TileDirectory& directory(std::uint32_t submap);
  /// Notes which tiles lie beside those at `places`, of the stored ones and of `more`.
  void note_neighbors(const std::vector<TilePlace>& places, const std::vector<TilePlace>& more);
  TileBorders borders_of(const TilePlace& place) const;
  Result<std::vector<Bytes>> read_all(const TileRecord& record) const;
  Status run_all(std::size_t count, const std::function<Status(std::size_t)>& body);
  Status holds_points() const;
  Status stopped() const {
    return settings.stop != nullptr && *settings.stop ? Status(make_error(ErrorCode::kCancelled, "stopped"))
                                                      : Status{};
  }
  Status remember(Status s) {
    if (!s.ok() && failed.ok()) failed = s;
    return s;
  }

  // insertion: what is held becomes segments of tiles.
  using Batch = std::map<TilePlace, std::vector<ScanPart>, TilePlaceLess>;
  Status flush();
  Status flush_some(Batch tiles);
  void sort_into_tiles(Batch& tiles, const Held& held);
  Batch take_some(Batch& tiles) const;
  Result<TileWork> prepare(const TilePlace& place);
  Status look_up_all(std::vector<TileWork>& work, const Batch& generous);
  Status store(TileWork& w);
  void account(const TileWork& w);

  // erasure
  Status erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap);
  Status erase_in(const TileRecord& record, const Erasure& e);
  Result<Erasure> in_submap(const Erasure& e, std::uint32_t submap) const;

  // folding, and splitting of tiles that grew.
  Status fold(std::size_t least);
  Status fold_some(const std::vector<TilePlace>& places);
  Status replace(const TilePlace& place, const Fold& f);
  Status split_large(std::vector<TilePlace> places);
  Result<std::vector<TilePlace>> split_one(const TilePlace& place);
};

}  // namespace mapcodec
