// SPDX-License-Identifier: GPL-3.0-or-later
// Writes maps: new archives, and new revisions of existing ones.
#pragma once

#include <memory>
#include <string>

#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"
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
