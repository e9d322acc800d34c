// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/octomap/occupancy_map.hpp"

#include <algorithm>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/cloud/occupancy_edit.hpp"
#include "mapcodec/codec/occupancy_decoder.hpp"
#include "mapcodec/codec/occupancy_layout.hpp"
#include "parallel/ordered_pipeline.hpp"

namespace mapcodec {
namespace {

/// A tile that cannot be read means a damaged archive, whatever the decoder calls it.
Error damaged(const Error& e) {
  if (e.code == ErrorCode::kCancelled || e.code == ErrorCode::kLimitExceeded) return e;
  return make_error(ErrorCode::kArchiveDamaged, e.message, e.offset);
}

Box cube_of(const CellCorner& corner, unsigned height, double resolution_m) {
  Box b;
  b.add(occupancy::center_of(corner, 0, resolution_m));
  b.add(occupancy::center_of(corner, 2.0 * double(1u << height), resolution_m));
  return b;
}

/// Whether a cube and a region share a point.
bool meets(const Region& region, const Box& cube) {
  if (region.box && !region.box->intersects(cube)) return false;
  if (!region.sphere) return true;
  Vec3 nearest = region.sphere->centre;
  double d2 = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    nearest[d] = std::clamp(nearest[d], cube.min[d], cube.max[d]);
    d2 += (nearest[d] - region.sphere->centre[d]) * (nearest[d] - region.sphere->centre[d]);
  }
  return d2 <= region.sphere->radius_m * region.sphere->radius_m;
}

std::size_t slots_of(Arena* arena) {
  return arena == nullptr ? 1 : 4 * static_cast<std::size_t>(arena->threads());
}

}  // namespace

Result<OccupancyMap> OccupancyMap::open(const std::string& path, std::optional<std::uint64_t> revision) {
  MAPCODEC_ASSIGN(MapFile file, MapFile::open(path, revision));
  if (const auto kind = occupancy_kind(file.schema())) {
    const double resolution_m = file.schema().tile_size_m;
    return OccupancyMap(std::move(file), *kind, resolution_m, std::nullopt);
  }
  const auto layer = octree_layer(file.archive().info());
  if (!layer.ok()) return damaged(layer.error());
  if (!*layer) return make_error(ErrorCode::kUnsupported, "holds no octree");
  MAPCODEC_TRY(check_octree_pose(file.archive().info()));
  return OccupancyMap(std::move(file), *(*layer)->schema.occupancy, (*layer)->schema.tile_size_m,
                      (*layer)->submap);
}

std::vector<std::size_t> OccupancyMap::tiles_in(const Region& region) const {
  if (!submap_) return file_.tiles_in(region);
  std::vector<std::size_t> found = file_.archive().tiles_in(region.bounds());
  std::erase_if(found, [&](std::size_t i) { return file_.archive().tiles()[i].submap != *submap_; });
  return found;
}

Result<OccupancyTree> OccupancyMap::read(const Region& region, const ReadSettings& settings) const {
  const std::vector<std::size_t> tiles = tiles_in(region);
  std::vector<OccupancyPiece> pieces;
  std::vector<Bytes> bytes(slots_of(settings.arena));
  std::vector<OccupancyPiece> decoded(bytes.size());
  std::size_t next = 0, done = 0;
  OrderedStages stages;
  stages.feed = [&](std::size_t slot) -> Result<bool> {
    if (next == tiles.size()) return false;
    MAPCODEC_ASSIGN(bytes[slot],
                    file_.archive().read(file_.archive().tiles()[tiles[next++]].segments.front()));
    return true;
  };
  stages.work = [&](std::size_t slot) -> Status {
    auto piece = decode_occupancy_tile(bytes[slot], settings.limits);
    if (!piece.ok()) return damaged(piece.error());
    if (piece->tree.kind != kind_)
      return make_error(ErrorCode::kArchiveDamaged, "an octree's tiles differ in kind");
    if (!region.everything()) {
      piece->tree = clip(piece->tree, corner_of(piece->key), [&](const CellCorner& corner, unsigned height) {
        return meets(region, cube_of(corner, height, resolution_m_));
      });
    }
    decoded[slot] = std::move(*piece);
    return {};
  };
  stages.drain = [&](std::size_t slot) -> Status {
    if (decoded[slot].tree.root != Cell::unknown) pieces.push_back(std::move(decoded[slot]));
    if (settings.progress) settings.progress({"decode", ++done, tiles.size(), 0});
    return {};
  };
  MAPCODEC_TRY(run_ordered(settings.arena, bytes.size(), stages, settings.stop, "decoding an octree"));
  std::vector<OccupancyExtra> nodes;
  const auto& extras = file_.archive().info().extras;
  if (const auto it = extras.find(kOctreeNodesExtra); it != extras.end() && region.everything()) {
    MAPCODEC_ASSIGN(nodes, read_octree_nodes(it->second));
  }
  const auto before = [](const OccupancyPiece& a, const OccupancyPiece& b) {
    return compare_morton(a.key, b.key) < 0;
  };
  if (submap_) std::sort(pieces.begin(), pieces.end(), before);  // stored by their places on the points' grid
  auto tree = join_pieces(pieces, nodes);
  if (!tree.ok()) return damaged(tree.error());
  tree->kind = kind_;
  return tree;
}

Bytes write_octree_nodes(const std::vector<OccupancyExtra>& nodes) {
  ByteWriter out;
  out.varint(nodes.size());
  for (const OccupancyExtra& n : nodes) {
    out.u8(n.key.level);
    for (const std::int32_t v : {n.key.x, n.key.y, n.key.z}) out.varint(static_cast<std::uint64_t>(v));
    out.u32(n.value);
    out.raw(n.color);
  }
  return out.take();
}

Result<std::vector<OccupancyExtra>> read_octree_nodes(ByteSpan bytes) {
  ByteReader in(bytes);
  std::vector<OccupancyExtra> nodes;
  const std::uint64_t count = in.varint();
  for (std::uint64_t i = 0; i < count && in.ok(); ++i) {
    OccupancyExtra n;
    n.key.level = in.u8();
    for (std::int32_t* v : {&n.key.x, &n.key.y, &n.key.z})
      *v = static_cast<std::int32_t>(in.varint() & 0xffff);
    n.value = in.u32();
    const ByteSpan color = in.raw(3);
    if (in.ok()) std::copy(color.begin(), color.end(), n.color.begin());
    nodes.push_back(n);
  }
  MAPCODEC_TRY(in.status("octree nodes"));
  return nodes;
}

namespace {

std::string first_difference(const OccupancyTree& a, const OccupancyTree& b) {
  if (a.root != b.root) return "one of the octrees is empty or a single leaf";
  for (unsigned h = kOccupancyHeight + 1; h-- > 0;) {
    const std::string where = " of side 2^" + std::to_string(h) + " voxels differ";
    const OccupancyLevel &x = a.levels[h], &y = b.levels[h];
    if (x.nodes != y.nodes) return "the cells below nodes" + where;
    if (x.leaf_values != y.leaf_values) return "log-odds of leaves" + where;
    if (x.leaf_colors != y.leaf_colors) return "colours of leaves" + where;
    if (x.node_values != y.node_values) return "log-odds of inner nodes" + where;
    if (x.node_colors != y.node_colors) return "colours of inner nodes" + where;
  }
  return {};
}

}  // namespace

Result<std::string> compare_occupancy_map(const std::string& path, const OctreeFile& original,
                                          const ReadSettings& settings) {
  MAPCODEC_ASSIGN(const OccupancyMap map, OccupancyMap::open(path));
  if (map.resolution_m() != original.resolution_m) return std::string("the resolution differs");
  if (map.kind() != original.tree.kind)
    return std::string("the map's leaves are ") + occupancy_name(map.kind()) + ", the original's " +
           occupancy_name(original.tree.kind);
  MAPCODEC_ASSIGN(const OccupancyTree tree, map.read({}, settings));
  return first_difference(tree, original.tree);
}

}  // namespace mapcodec
