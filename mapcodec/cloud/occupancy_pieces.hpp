// SPDX-License-Identifier: GPL-3.0-or-later
// An octree cut into subtrees, and put together again.
#pragma once

#include <functional>
#include <span>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/occupancy_tree.hpp"

namespace mapcodec {

/// A subtree and its place: the tile of a map whose level-0 tile is one voxel and whose origin is the corner
/// of OctoMap's key space, so that x, y, z are OctoMap's keys shifted right by the level.
struct OccupancyPiece {
  TileKey key;  ///< level = tree.height
  OccupancyTree tree;
};

/// An inner node above all pieces whose value or colour is not what its children make of it.
struct OccupancyExtra {
  TileKey key;
  std::uint32_t value = 0;
  OccupancyColor color = kNoColor;
  bool operator==(const OccupancyExtra&) const = default;
};

[[nodiscard]] CellCorner corner_of(const TileKey& key);

/// Pieces of at most `most_nodes` inner nodes each, as large as that allows, in Morton order. No piece: the
/// tree is empty. What stands above them is implied but for `extras`. None is lower than `least_height`, even
/// if it is larger then.
[[nodiscard]] std::vector<OccupancyPiece> cut_tree(const OccupancyTree& tree, std::uint64_t most_nodes,
                                                   std::vector<OccupancyExtra>& extras,
                                                   const TileKey& root = {0, 0, 0, kOccupancyHeight},
                                                   std::uint8_t least_height = 0);

/// Undoes cut_tree. A tree of height 16.
/// @param pieces  in Morton order, all of one kind.
/// Errors: Malformed (pieces overlap or are out of order, kinds differ, a key out of OctoMap's range).
[[nodiscard]] Result<OccupancyTree> join_pieces(std::span<const OccupancyPiece> pieces,
                                                std::span<const OccupancyExtra> extras);

}  // namespace mapcodec
