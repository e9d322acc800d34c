// SPDX-License-Identifier: GPL-3.0-or-later
// The file header and the fixed-size record that ends every commit (FORMAT.md, Header and Record).
#pragma once

#include <array>
#include <optional>

#include "maps/tile_store.hpp"

namespace mapcodec {

inline constexpr std::size_t kHeaderBytes = 8;
inline constexpr std::size_t kRecordBytes = 32;
inline constexpr std::uint64_t kWaypointEvery = std::uint64_t{1}
                                                << 20;  ///< bytes of segments between waypoints
/// How far back from the end a record or a waypoint must be found: one largest segment, one largest index,
/// and slack.
inline constexpr std::uint64_t kMaxSearchBytes = (std::uint64_t{1} << 31) + (std::uint64_t{1} << 22);
inline constexpr std::uint64_t kMaxBlockBytes = std::uint64_t{1} << 30;  ///< index and metadata of one commit

/// Ends a commit; or, as a waypoint inside an unfinished one, points back to the last whole commit.
struct CommitRecord {
  bool waypoint = false;
  std::int64_t timestamp_s = 0;      ///< 0 .. 2^40 - 1
  std::uint64_t previous = 0;        ///< offset of the previous commit record; 0: none
  std::uint32_t revision = 0;        ///< from 1
  std::uint32_t index_bytes = 0;     ///< the block before the metadata
  std::uint32_t metadata_bytes = 0;  ///< the block before the record; 0: as in the previous commit

  [[nodiscard]] std::uint64_t block_bytes() const { return std::uint64_t{index_bytes} + metadata_bytes; }
  bool operator==(const CommitRecord&) const = default;
};

/// A whole commit as it lies in a store.
struct Commit {
  CommitRecord record;
  std::uint64_t offset = 0;  ///< of the record
  Bytes blocks;              ///< index, then metadata

  [[nodiscard]] ByteSpan index() const { return ByteSpan(blocks).first(record.index_bytes); }
  [[nodiscard]] ByteSpan metadata() const { return ByteSpan(blocks).subspan(record.index_bytes); }
  [[nodiscard]] std::uint64_t end() const { return offset + kRecordBytes; }
  [[nodiscard]] std::uint64_t segments_begin() const {
    return record.previous == 0 ? kHeaderBytes : record.previous + kRecordBytes;
  }
  [[nodiscard]] std::uint64_t segments_end() const { return offset - record.block_bytes(); }
};

[[nodiscard]] std::array<std::uint8_t, kHeaderBytes> archive_header();
/// Errors: Empty (no byte), Malformed (not an archive), ArchiveDamaged (text-mode transfer, cut), Unsupported
/// (newer).
[[nodiscard]] Status check_header(const TileStore& store);

/// The record's bytes, for `offset`, after `blocks`.
[[nodiscard]] std::array<std::uint8_t, kRecordBytes> write_record(const CommitRecord& record,
                                                                  std::uint64_t offset, ByteSpan blocks);
/// The checksum of a record at `offset`. @param fields  the record without its checksum.
[[nodiscard]] std::uint32_t commit_crc(std::uint64_t offset, ByteSpan blocks, ByteSpan fields);
/// The commit or waypoint whose record stands at `offset`. Errors: ArchiveDamaged, Unreadable.
[[nodiscard]] Result<Commit> read_commit(const TileStore& store, std::uint64_t offset);
/// The last whole commit: from the end backwards, ignoring what an unfinished commit left.
/// Errors: as check_header and read_commit; ArchiveDamaged (there is none).
[[nodiscard]] Result<Commit> find_last_commit(const TileStore& store);
/// The last whole commit that ends at or before `end`, searched through all of the file: for repair.
/// Errors: ArchiveDamaged (there is none), Unreadable.
[[nodiscard]] Result<Commit> find_commit_before(const TileStore& store, std::uint64_t end);
/// True if the last bytes look like a damaged commit record (one byte of its magic may be wrong): not what an
/// interrupted writer leaves.
[[nodiscard]] bool ends_like_commit(const TileStore& store);

}  // namespace mapcodec
