// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <unordered_map>

#include "mapcodec/cloud/occupancy_edit.hpp"
#include "mapcodec/codec/occupancy_decoder.hpp"
#include "mapcodec/codec/occupancy_encoder.hpp"
#include "parallel/ordered_pipeline.hpp"
#include "slam_adapter/octomap/occupancy_map.hpp"
#include "slam_adapter/octomap/octree_target.hpp"

namespace mapcodec {
namespace {

std::uint64_t most_nodes(const OccupancyWrite& settings) {
  return settings.most_nodes > 0 ? settings.most_nodes : kOccupancyTileNodes;
}

using TileSink = std::function<Status(const TileKey&, EncodedTile&&)>;

/// Encodes pieces in parallel and hands them on in order.
Status encode_pieces(const std::vector<OccupancyPiece>& pieces, double resolution_m,
                     const OccupancyWrite& settings, const TileSink& sink) {
  std::vector<EncodedTile> coded(
      settings.arena == nullptr ? 1 : 4 * static_cast<std::size_t>(settings.arena->threads()));
  std::vector<std::size_t> item(coded.size());
  std::size_t next = 0;
  std::uint64_t leaves = 0;
  OrderedStages stages;
  stages.feed = [&](std::size_t slot) -> Result<bool> {
    if (next == pieces.size()) return false;
    item[slot] = next++;
    return true;
  };
  stages.work = [&](std::size_t slot) -> Status {
    coded[slot] = encode_occupancy_tile(pieces[item[slot]], resolution_m);
    return {};
  };
  stages.drain = [&](std::size_t slot) -> Status {
    leaves += coded[slot].points;
    if (settings.progress) settings.progress({"tiles", leaves, leaves, 0});
    return sink(pieces[item[slot]].key, std::move(coded[slot]));
  };
  return run_ordered(settings.arena, coded.size(), stages, settings.stop, "encoding an octree");
}

Status add_tile(MapWriter& writer, const OctreeTarget& target, const TileKey& key, const EncodedTile& t) {
  return writer.add(target.places.tile_of(key), static_cast<std::uint8_t>(t.codec), t.points, t.bounds,
                    t.errors, t.bytes, target.layer.submap);
}

MapInfo facts(const MapSchema& schema) {
  MapInfo info;
  info.schema = write_schema(schema);
  info.origin = schema.origin;
  info.tile_size_m = schema.tile_size_m;
  return info;
}

/// Walks the new tree down to where the map's tiles are.
class Changes {
 public:
  Changes(MapWriter& writer, const OctreeTarget& target, const OccupancyTree& tree, std::uint64_t most,
          const std::vector<CellCorner>* changed)
      : writer_(writer),
        top_(tree),
        most_(most),
        least_height_(target.places.least_height()),
        whole_(changed != nullptr) {
    for (const TileRecord* t : writer.tiles()) {
      if (t->submap == target.layer.submap) note_tile(target.places.octree_key_of(t->key), t);
    }
    if (changed == nullptr) return;
    for (const CellCorner& c : *changed) {
      for (unsigned h = 0; h <= kOccupancyHeight; ++h) touched_.insert({key_at(c, h), 0});
    }
  }

  Status run() { return look(top_.root(), {0, 0, 0, kOccupancyHeight}); }

  std::vector<OccupancyPiece> pieces;  ///< to be written, in Morton order
  std::vector<TileKey> removed;
  std::vector<OccupancyExtra> nodes;  ///< of the pieces' tops
  std::uint64_t touched = 0, fresh = 0;

 private:
  using Counts = std::unordered_map<TileKey, std::uint64_t, TileKeyHash>;

  static TileKey key_at(const CellCorner& c, unsigned h) {
    return {static_cast<std::int32_t>(c[0] >> h), static_cast<std::int32_t>(c[1] >> h),
            static_cast<std::int32_t>(c[2] >> h), static_cast<std::uint8_t>(h)};
  }

  void note_tile(TileKey key, const TileRecord* tile) {
    tiles_.emplace(key, tile);
    while (key.level < kOccupancyHeight) {
      key = {key.x >> 1, key.y >> 1, key.z >> 1, static_cast<std::uint8_t>(key.level + 1)};
      above_[key] += 1;
    }
  }

  Status look(const OccupancyCell& cell, const TileKey& key) {
    if (whole_ ? touched_.count(key) == 0 : cell.cell == Cell::unknown) return {};
    if (const auto tile = tiles_.find(key); tile != tiles_.end()) return change(key, *tile->second, cell);
    if (above_.count(key) == 0) {
      add(cell, key);
      return {};
    }
    if (cell.cell != Cell::inner) {
      remove_within(key);
      add(cell, key);
      return {};
    }
    for (unsigned c = 0; c < 8; ++c) {
      const TileKey below{static_cast<std::int32_t>(2 * key.x + static_cast<int>(c & 1)),
                          static_cast<std::int32_t>(2 * key.y + static_cast<int>(c >> 1 & 1)),
                          static_cast<std::int32_t>(2 * key.z + static_cast<int>(c >> 2)),
                          static_cast<std::uint8_t>(key.level - 1)};
      MAPCODEC_TRY(look(top_.child(cell, c), below));
    }
    return {};
  }

  Status change(const TileKey& key, const TileRecord& tile, const OccupancyCell& cell) {
    MAPCODEC_ASSIGN(const Bytes bytes, writer_.read(tile.segments.front()));
    MAPCODEC_ASSIGN(OccupancyPiece old, decode_occupancy_tile(bytes));
    OccupancyTree now = top_.subtree(cell);
    if (!whole_) now = overlay(old.tree, now);
    if (now == old.tree) return {};
    ++touched;
    if (now.root == Cell::unknown || now.inner_count() > 2 * most_) removed.push_back(key);
    if (now.root == Cell::unknown) return {};
    cut(now, key, now.inner_count() > 2 * most_ ? most_ : 2 * most_);
    return {};
  }

  void add(const OccupancyCell& cell, const TileKey& key) {
    if (cell.cell == Cell::unknown) return;
    const std::size_t before = pieces.size();
    cut(top_.subtree(cell), key, most_);
    touched += pieces.size() - before;
    fresh += pieces.size() - before;
  }

  void cut(const OccupancyTree& tree, const TileKey& key, std::uint64_t most) {
    for (OccupancyPiece& p : cut_tree(tree, most, nodes, key, least_height_)) pieces.push_back(std::move(p));
  }

  void remove_within(const TileKey& key) {
    for (const auto& [k, t] : tiles_) {
      const int up = key.level - k.level;
      if (up > 0 && k.x >> up == key.x && k.y >> up == key.y && k.z >> up == key.z) removed.push_back(k);
    }
    touched += removed.size();
  }

  MapWriter& writer_;
  OccupancyIndex top_;
  std::uint64_t most_;
  std::uint8_t least_height_;
  bool whole_;  ///< tiles become what the tree says, not an overlay
  std::unordered_map<TileKey, const TileRecord*, TileKeyHash> tiles_;
  Counts above_, touched_;
};

/// Extras below changed tiles are out of date; those of other places stay.
std::vector<OccupancyExtra> merged_nodes(const MapInfo& info, const Changes& changes) {
  std::vector<OccupancyExtra> kept = changes.nodes;
  const auto it = info.extras.find(kOctreeNodesExtra);
  if (it == info.extras.end()) return kept;
  const auto old = read_octree_nodes(it->second);
  if (!old.ok()) return kept;
  const auto lies_over = [](const TileKey& a, const TileKey& k) {
    const int up = a.level - k.level;
    return up >= 0 && k.x >> up == a.x && k.y >> up == a.y && k.z >> up == a.z;
  };
  for (const OccupancyExtra& e : *old) {
    const bool stale = std::any_of(changes.pieces.begin(), changes.pieces.end(),
                                   [&](const auto& p) { return lies_over(e.key, p.key); }) ||
                       std::any_of(changes.removed.begin(), changes.removed.end(),
                                   [&](const auto& k) { return lies_over(e.key, k); });
    if (!stale) kept.push_back(e);
  }
  return kept;
}

Result<OccupancyTree> fitted(const OccupancyTree& tree, double resolution_m, const MapSchema& schema) {
  const OccupancyKind kind = *schema.occupancy;
  if (schema.tile_size_m != resolution_m)
    return make_error(ErrorCode::kInvalidArgument,
                      "the map's resolution is " + std::to_string(schema.tile_size_m) + " m, the octree's " +
                          std::to_string(resolution_m) + " m");
  if (tree.kind != kind && kind == OccupancyKind::binary) return to_binary(tree);
  if (tree.kind != kind)
    return make_error(ErrorCode::kInvalidArgument, std::string("the map's leaves are ") +
                                                       occupancy_name(kind) + ", the octree's " +
                                                       occupancy_name(tree.kind));
  return tree;
}

}  // namespace

Status create_occupancy_map(const std::string& path, const OccupancyTree& tree, double resolution_m,
                            const OccupancyWrite& settings) {
  std::vector<OccupancyExtra> nodes;
  const std::vector<OccupancyPiece> pieces = cut_tree(tree, most_nodes(settings), nodes);
  if (pieces.empty()) return make_error(ErrorCode::kEmpty, "octree: holds no leaf");
  const OctreeTarget target{{0, occupancy_schema(tree.kind, resolution_m)}, {}};
  MapInfo info = facts(target.layer.schema);
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::create(path, info, settings.overwrite));
  MAPCODEC_TRY(encode_pieces(pieces, resolution_m, settings, [&](const TileKey& key, EncodedTile&& t) {
    info.bounds.add(t.bounds);
    return add_tile(writer, target, key, t);
  }));
  info.input_points = tree.leaf_count();
  info.input_bytes = settings.input_bytes;
  if (!nodes.empty()) info.extras[kOctreeNodesExtra] = write_octree_nodes(nodes);
  MAPCODEC_TRY(writer.set_info(std::move(info)));
  const auto revision = writer.commit(settings.timestamp_s);
  return revision.ok() ? Status{} : Status(revision.error());
}

Result<UpdateReport> lay_octree(MapWriter& writer, const OccupancyTree& tree, double resolution_m,
                                const OccupancyWrite& settings, const std::vector<CellCorner>* changed) {
  MAPCODEC_ASSIGN(const OctreeTarget target, octree_target(writer, tree.kind, resolution_m));
  MAPCODEC_ASSIGN(const OccupancyTree top, fitted(tree, resolution_m, target.layer.schema));
  Changes changes(writer, target, top, most_nodes(settings), changed);
  MAPCODEC_TRY(changes.run());
  UpdateReport report;
  report.points_in = top.leaf_count();
  report.revision = writer.revision();
  report.tiles_touched = changes.touched;
  report.tiles_new = changes.fresh;
  report.tiles_removed = changes.removed.size();
  if (changes.pieces.empty() && changes.removed.empty()) return report;
  MapInfo info = writer.info();
  const std::vector<OccupancyExtra> nodes = merged_nodes(info, changes);
  info.extras.erase(kOctreeNodesExtra);
  if (!nodes.empty()) info.extras[kOctreeNodesExtra] = write_octree_nodes(nodes);
  for (const TileKey& key : changes.removed)
    MAPCODEC_TRY(writer.remove(target.places.tile_of(key), target.layer.submap));
  MAPCODEC_TRY(
      encode_pieces(changes.pieces, resolution_m, settings, [&](const TileKey& key, EncodedTile&& t) {
        report.bytes += t.bytes.size();
        report.points_added += t.points;
        return add_tile(writer, target, key, t);
      }));
  info.bounds = writer.posed_bounds();
  if (!octree_submap(info)) info.input_points += report.points_in;  // of points otherwise
  info.input_bytes += settings.input_bytes;
  MAPCODEC_TRY(writer.set_info(std::move(info)));
  report.committed = true;
  return report;
}

Result<UpdateReport> update_occupancy_map(const std::string& path, const OccupancyTree& tree,
                                          double resolution_m, const OccupancyWrite& settings,
                                          const std::vector<CellCorner>* changed) {
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(path));
  MAPCODEC_ASSIGN(UpdateReport report, lay_octree(writer, tree, resolution_m, settings, changed));
  if (!report.committed) return report;
  MAPCODEC_ASSIGN(report.revision, writer.commit(settings.timestamp_s));
  return report;
}

}  // namespace mapcodec
