// SPDX-License-Identifier: GPL-3.0-or-later
// The index block of a commit (FORMAT.md, Index).
#pragma once

#include <vector>

#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"
#include "maps/tile_bounds.hpp"

namespace mapcodec {

/// A tile as the index holds it. Keeping the code beside the box keeps rewriting from widening the box.
struct IndexEntry {
  TileRecord record;
  BoundsCode bounds;
};

/// Which tile, without what it holds.
struct TileId {
  std::uint32_t submap = 0;
  TileKey key;
  bool operator==(const TileId&) const = default;
};
[[nodiscard]] inline TileId id_of(const TileRecord& r) {
  return {r.submap, r.key};
}
struct TileIdLess {
  bool operator()(const TileId& a, const TileId& b) const {
    return compare_tiles(a.submap, a.key, b.submap, b.key) < 0;
  }
};

/// All tiles, or the changes against the previous commit's.
struct IndexBlock {
  bool delta = false;
  bool hashes = false;          ///< content hashes are stored: every tile of `set` must have them
  std::uint64_t tiles = 0;      ///< of the map after this commit
  std::vector<IndexEntry> set;  ///< all, or the new and the changed ones; in order
  std::vector<TileId> removed;  ///< delta only; in order
  std::vector<SegmentRef>
      dead;  ///< ranges of this commit that are no tile's: waypoints, tiles replaced before the commit
};

/// What surrounds a block.
struct IndexContext {
  Vec3 origin{0, 0, 0};
  double tile_size_m = 1;
  TileErrors achieved;               ///< as decoded from the commit's metadata
  std::uint64_t segments_begin = 0;  ///< where this commit's segments begin
  std::uint64_t segments_end = 0;    ///< where they end; no segment lies beyond (decoding only)
};

/// @param block  ordered; every tile has a segment.
[[nodiscard]] Bytes encode_index(const IndexBlock& block, const IndexContext& context);

/// Decodes a block, which may be hostile. Memory stays within limits.max_bytes and a small multiple of the
/// block's bytes. Errors: Truncated, Malformed (order, ranges), LimitExceeded.
[[nodiscard]] Result<IndexBlock> decode_index(ByteSpan bytes, const IndexContext& context,
                                              const DecodeLimits& limits = {});

/// Number of tiles after the commit, and what kind of block it is, from its first bytes.
struct IndexHead {
  bool delta = false;
  bool hashes = false;
  std::uint64_t tiles = 0;
};
[[nodiscard]] Result<IndexHead> decode_index_head(ByteSpan bytes);

}  // namespace mapcodec
