// SPDX-License-Identifier: GPL-3.0-or-later
// What a MapWriter knows between commits, and how it becomes a commit.
#pragma once

#include <map>
#include <memory>

#include "maps/archive_state.hpp"

namespace mapcodec {

struct WriterState {
  std::unique_ptr<TileStore> store;
  MapInfo info;
  std::map<TileId, IndexEntry, TileIdLess> entries;
  std::map<TileId, bool, TileIdLess>
      changed;                         // since the last commit; true: the tile was there at that commit
  std::vector<SegmentRef> dead;        // ranges of this commit that are no tile's
  ArchiveState last;                   // without its entries; revision 0: there is none
  std::uint64_t begin = kHeaderBytes;  // of this commit's segments
  std::uint64_t waypoint = 0;          // end of the last record or waypoint
  std::uint64_t points = 0;            // of all tiles; wraps around
  bool hashes = false;                 // store them
  std::uint64_t next_revision = 0;     // number of the next commit; 0: one more than the last

  void resume(ArchiveState state);
  [[nodiscard]] Result<IndexEntry> make_entry(const TileId& id, std::uint64_t tile_points, const Box& bounds,
                                              const TileErrors& errors) const;
  [[nodiscard]] Status write_segment(IndexEntry& entry, ByteSpan bytes);
  /// Takes the place of the tile of this name, if there is one.
  void put(const TileId& id, IndexEntry entry);
  void erase(std::map<TileId, IndexEntry, TileIdLess>::iterator at);
  [[nodiscard]] Status restore(std::uint64_t revision);
  [[nodiscard]] Result<std::uint64_t> commit(std::int64_t timestamp_s);

 private:
  [[nodiscard]] Status write_waypoint();
  void touch(const TileId& id) { changed.try_emplace(id, entries.count(id) > 0); }
  void bury(const IndexEntry& entry);
  [[nodiscard]] bool stores_hashes(const IndexBlock& block) const;
  [[nodiscard]] IndexBlock full_block() const;
  [[nodiscard]] IndexBlock delta_block() const;
  /// The index block of the next commit, encoded. @param delta  set to what it is.
  [[nodiscard]] Bytes encode_block(const IndexContext& context, bool& delta) const;
  [[nodiscard]] Result<CommitRecord> make_record(std::int64_t timestamp_s, std::size_t index_bytes,
                                                 std::size_t head_bytes) const;
  void advance(const CommitRecord& record, std::uint64_t offset, bool delta);
};

}  // namespace mapcodec
