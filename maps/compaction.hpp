// SPDX-License-Identifier: GPL-3.0-or-later
// Rewriting an archive without what nobody needs, and saving what is whole of a damaged one.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"
#include "maps/tile_store.hpp"

namespace mapcodec {

/// A tile with one base segment.
struct FoldedTile {
  std::uint8_t codec = 0;
  std::uint64_t points = 0;
  Box bounds;  ///< [m, submap frame]
  TileErrors errors;
  Bytes bytes;
};

/// Folds the segments of a tile (base, then deltas: at least two) into one base; nothing: leave it as it is.
/// Must be pure: same bytes, same result. Called from one thread, tile after tile.
using TileFolder = std::function<Result<std::optional<FoldedTile>>(
    const MapInfo& info, const TileRecord& tile, const std::vector<Bytes>& segments)>;

struct CompactSettings {
  std::uint64_t keep_last = 1;  ///< newest revisions that are kept beside the snapshots'; at least 1
  std::optional<bool> hashes;   ///< store content hashes; nothing: as the newest revision does
  TileFolder fold;              ///< may be empty: segments stay as they are
  std::function<bool()> stop;   ///< asked before each tile; true: ends with Cancelled
};

struct CompactReport {
  std::uint64_t bytes_before = 0, bytes_after = 0;
  std::uint64_t revisions_before = 0, revisions_after = 0;
  std::uint64_t segments_before = 0, segments_after = 0;  ///< of all kept revisions, each once
  std::uint64_t folded_tiles = 0;
  std::uint64_t tiles = 0;  ///< of the newest revision
  bool hashes = false;      ///< stored
};

/// Rewrites the archive with the newest revisions and those of snapshots, under their numbers, tiles in
/// Morton order, and renames it over `path` (through a symbolic link: over what it names). Readers that have
/// the old file open go on undisturbed; a writer excludes it and is excluded by it. Compacting what was
/// compacted gives the same bytes. After any error the archive is as it was.
/// Errors: as MapArchive::open; CannotWrite (another writer, permission, disk); ChecksumMismatch or
/// ArchiveDamaged (a damaged tile: see `repair_archive`); Cancelled; what `fold` returns.
[[nodiscard]] Result<CompactReport> compact_archive(const std::string& path,
                                                    const CompactSettings& settings = {});

/// A tile that a damaged archive had.
struct LostTile {
  std::uint32_t submap = 0;
  TileKey key;
  std::uint64_t points = 0;
  std::uint64_t revision = 0;  ///< that held it
  std::string reason;
  std::uint64_t saved_revision = 0;  ///< whose older version of the tile was saved instead; 0: none
};

struct RepairReport {
  std::uint64_t revision = 0;  ///< that was saved
  std::uint64_t tiles_saved = 0, points_saved = 0;
  std::uint64_t points_lost = 0;       ///< of the saved revision, less what older versions of its tiles hold
  std::vector<LostTile> lost;          ///< of all saved revisions, each damaged version once
  std::vector<std::string> notes;      ///< what else is lost: newer revisions, snapshots
  std::vector<std::string> corrected;  ///< single wrong bytes that a checksum located: nothing is lost
  std::uint64_t bytes_before = 0, bytes_after = 0;

  [[nodiscard]] bool saved_all() const { return lost.empty() && notes.empty(); }
};

/// Writes to `output` the undamaged tiles of the newest readable revision of `path` and of its readable
/// snapshots. Never writes to `path`. A single wrong byte of a commit's index, facts or record is found by
/// its checksum and read as it was; tiles are never guessed at: in the place of a damaged one comes its
/// newest older version that is whole. Errors: NotFound, Unreadable, Empty, Malformed, Unsupported (as
/// MapArchive::open); ArchiveDamaged (no revision can be read); CannotWrite (exists and not `overwrite`, is
/// the input, disk).
[[nodiscard]] Result<RepairReport> repair_archive(const std::string& path, const std::string& output,
                                                  bool overwrite = false);
/// The same from any store to an empty one.
[[nodiscard]] Result<RepairReport> repair_archive(const TileStore& store, TileStore& out);

}  // namespace mapcodec
