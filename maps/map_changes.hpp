// SPDX-License-Identifier: GPL-3.0-or-later
// What differs between two maps, tile by tile, by content.
#pragma once

#include <optional>
#include <set>
#include <vector>

#include "maps/content_hash.hpp"
#include "maps/map_archive.hpp"

namespace mapcodec {

enum class ChangeKind : std::uint8_t { added, changed, removed };

/// One tile that differs.
struct TileChange {
  ChangeKind kind = ChangeKind::added;
  std::uint32_t submap = 0;
  TileKey key;
  std::uint64_t points_before = 0, points_after = 0;
  std::uint64_t bytes_before = 0, bytes_after = 0;  ///< of the segments
  std::optional<std::size_t> tile;  ///< its index in `to.tiles()`; nothing where it was removed
  ContentHash hash;                 ///< of the tile after; zero where it was removed or hashes were not asked
};

/// Added, changed and removed tiles, in the order of tiles. Two revisions of one opened archive (see
/// MapArchive::at) are compared by their index, and only segments that moved are read; different archives by
/// hash.
/// @param with_hashes  computes `hash` of what was added or changed, reading it where no hash is stored.
/// Errors: as MapArchive::read.
[[nodiscard]] Result<std::vector<TileChange>> diff_maps(const MapArchive& from, const MapArchive& to,
                                                        bool with_hashes);

/// What a reader that has revision `since` needs for the one `archive` stands at, with hashes. 0: everything.
/// Facts beside the tiles (poses, bounds, snapshots) stand in MapArchive::info.
/// Errors: NotFound (no such revision, or compaction dropped it: then compare hashes, `missing_tiles`),
/// InvalidArgument (a newer revision), as MapArchive::read.
[[nodiscard]] Result<std::vector<TileChange>> changes_since(const MapArchive& archive, std::uint64_t since);

/// Indices into archive.tiles() of those whose content is not among `have`. Reads the segments of tiles
/// without stored hashes. Errors: as MapArchive::read.
[[nodiscard]] Result<std::vector<std::size_t>> missing_tiles(const MapArchive& archive,
                                                             const std::set<ContentHash>& have);

}  // namespace mapcodec
