// SPDX-License-Identifier: GPL-3.0-or-later
// Writes maps: new archives, and new revisions of existing ones.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"
#include "maps/submap_pose.hpp"
#include "maps/tile_store.hpp"

namespace mapcodec {

/// One writer per archive (flock). What was added counts only after `commit`; destruction without it leaves a
/// new archive's path as it was and an old archive at its last revision. After CannotWrite nothing more can
/// be written. Moved-from writers may only be destroyed. Threads: one at a time.
class MapWriter {
 public:
  /// Begins a new archive, written beside `path` and renamed to it by the first commit.
  /// @param overwrite  replace an existing file; otherwise that is an error.
  /// Errors: InvalidArgument (info), CannotWrite (exists, permission, no such folder, being written by
  /// another).
  [[nodiscard]] static Result<MapWriter> create(const std::string& path, MapInfo info, bool overwrite);
  /// The same in any empty store.
  [[nodiscard]] static Result<MapWriter> create(std::unique_ptr<TileStore> store, MapInfo info);
  /// Continues an archive after its last whole revision; remains of an unfinished commit are cut off.
  /// Errors: as MapArchive::open; CannotWrite (permission, another writer); ArchiveDamaged also where the
  /// file ends with a commit that was whole once: cutting that off would lose it.
  [[nodiscard]] static Result<MapWriter> open(const std::string& path);
  /// The same in any store.
  [[nodiscard]] static Result<MapWriter> open(std::unique_ptr<TileStore> store);

  MapWriter(MapWriter&&) noexcept;
  MapWriter& operator=(MapWriter&&) noexcept;
  ~MapWriter();

  /// Adds a tile, or replaces it with a new base.
  /// @param bytes   1 .. kMaxSegmentBytes, written at once.
  /// @param bounds  [m, submap frame] of its points; may be empty for an unplaced tile.
  /// Errors: InvalidArgument (level, size, bounds or errors not finite), CannotWrite.
  [[nodiscard]] Status add(const TileKey& key, std::uint8_t codec, std::uint64_t points, const Box& bounds,
                           const TileErrors& errors, ByteSpan bytes, std::uint32_t submap = 0);
  /// Appends a delta segment to a tile; points, bounds and errors are those of the tile with it.
  /// Errors: as add; NotFound.
  [[nodiscard]] Status extend(const TileKey& key, std::uint64_t points, const Box& bounds,
                              const TileErrors& errors, ByteSpan bytes, std::uint32_t submap = 0);
  /// Errors: NotFound.
  [[nodiscard]] Status remove(const TileKey& key, std::uint32_t submap = 0);

  [[nodiscard]] const MapInfo& info() const;
  [[nodiscard]] std::size_t tile_count() const;
  /// Facts of the next revision. Errors: InvalidArgument (as create; or origin or tile size differ).
  [[nodiscard]] Status set_info(MapInfo info);

  /// Number of the last committed revision; 0: none yet.
  [[nodiscard]] std::uint64_t revision() const;
  /// The tiles as the next commit will have them, in order. Pointers are good until the tile is changed.
  [[nodiscard]] std::vector<const TileRecord*> tiles() const;
  /// Those whose bounds meet `box` [m, map frame] as the poses stand.
  [[nodiscard]] std::vector<const TileRecord*> tiles_in(const Box& box) const;
  /// nullptr: there is none. Good until the tile is changed.
  [[nodiscard]] const TileRecord* find(const TileKey& key, std::uint32_t submap = 0) const;
  /// The bytes of a segment, committed or not, checked. Errors: ChecksumMismatch, ArchiveDamaged, Unreadable.
  [[nodiscard]] Result<Bytes> read(const SegmentRef& segment) const;
  /// A box around the bounds of all tiles as the poses stand [m, map frame]; empty without placed tiles.
  [[nodiscard]] Box posed_bounds() const;

  /// Moves submaps; the map's bounds follow (`posed_bounds`). No tile is touched: the commit holds the table
  /// of submaps. All or none are changed.
  /// Errors: InvalidArgument (no such submap, NaN, a quaternion not of length 1 within 1e-6).
  [[nodiscard]] Status set_poses(std::span<const PoseChange> changes);
  /// Names the last committed revision. The name becomes good with the next commit.
  /// Errors: InvalidArgument (name empty, longer than 255 bytes, of digits only, with control characters, or
  /// taken; nothing committed yet).
  [[nodiscard]] Status add_snapshot(const std::string& name);
  /// Errors: NotFound.
  [[nodiscard]] Status remove_snapshot(const std::string& name);
  /// Tiles and facts become those of `revision`, but for the snapshots, which stay. No tile is written.
  /// Errors: NotFound (no such revision, or compaction dropped it), InvalidArgument (changes not committed),
  /// ArchiveDamaged, Unreadable.
  [[nodiscard]] Status restore(std::uint64_t revision);
  /// The next commit gets this number: for copies of other archives, whose revisions keep their names.
  /// Errors: InvalidArgument (not above the last one, or beyond 32 bits).
  [[nodiscard]] Status number_next(std::uint64_t revision);
  /// From now on indexes store content hashes, as far as those of all their segments are known; archives that
  /// have them keep them without asking. Compaction fills in the missing ones.
  void store_hashes(bool store);

  /// Ends the revision: after it returns, it is on the disk and what new readers see.
  /// @param timestamp_s  [s since epoch], 0 .. 2^40 - 1; the archive never asks a clock.
  /// @return the revision's number, from 1.
  /// Errors: InvalidArgument (timestamp), LimitExceeded (index beyond 1 GiB), CannotWrite.
  [[nodiscard]] Result<std::uint64_t> commit(std::int64_t timestamp_s);

 private:
  struct State;
  explicit MapWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace mapcodec
