// SPDX-License-Identifier: GPL-3.0-or-later
// A map as stored, read at one revision.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"
#include "maps/tile_store.hpp"

namespace mapcodec {

struct Commit;

/// What `MapArchive::verify` found.
struct VerifyReport {
  std::vector<Error>
      findings;  ///< each with its byte offset; empty: every byte is accounted for and as written
  std::uint64_t file_bytes = 0;
  std::uint64_t checked_bytes = 0;  ///< bytes under a checksum that matched
  std::uint64_t live_bytes = 0;     ///< segments of this revision
  std::uint64_t dead_bytes = 0;     ///< segments that only other revisions use, and ranges that none uses
  std::uint64_t trailing_bytes =
      0;  ///< after the last whole commit: an unfinished one, or a damaged last one (a finding)
  bool lost_newest = false;  ///< those bytes end like a commit that was whole once
  std::uint64_t revisions = 0;
  std::uint64_t segments = 0;

  [[nodiscard]] bool ok() const { return findings.empty(); }
  /// True if all that was found is the tail of a commit that was not finished, or not yet: a writer at work
  /// or one that was killed leaves it, and nothing that was committed is missing.
  [[nodiscard]] bool only_unfinished() const {
    return findings.size() == 1 && trailing_bytes > 0 && !lost_newest;
  }
};

/// Reads need no lock: a writer in another process may append meanwhile, and this object stays at its
/// revision. Threads: const methods from many at once.
class MapArchive {
 public:
  /// Opens the newest whole revision, or the given one.
  /// Errors: NotFound (file, revision), Unreadable (permission, folder), Empty (no byte), Malformed (not an
  /// archive), Unsupported (newer format), ArchiveDamaged (with offset), LimitExceeded.
  [[nodiscard]] static Result<MapArchive> open(const std::string& path,
                                               std::optional<std::uint64_t> revision = std::nullopt,
                                               const DecodeLimits& limits = {});
  /// The same from any store.
  [[nodiscard]] static Result<MapArchive> open(std::unique_ptr<TileStore> store,
                                               std::optional<std::uint64_t> revision = std::nullopt,
                                               const DecodeLimits& limits = {});

  /// The same archive, as it was when opened, at another of its revisions; shares the open file, so that
  /// compaction cannot come between. Errors: as open.
  [[nodiscard]] Result<MapArchive> at(std::uint64_t revision, const DecodeLimits& limits = {}) const;
  /// The number that `text` means: the name of a snapshot, or a number of 1 to 10 digits (which need not
  /// exist). Names as this revision has them. Errors: NotFound (with the names there are).
  [[nodiscard]] Result<std::uint64_t> resolve(const std::string& text) const;

  [[nodiscard]] const MapInfo& info() const { return info_; }
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  [[nodiscard]] std::int64_t timestamp_s() const {
    return timestamp_s_;
  }  ///< of the revision [s since epoch]
  /// All tiles, submap by submap, each in Morton order.
  [[nodiscard]] const std::vector<TileRecord>& tiles() const { return tiles_; }
  /// Indices into tiles() of those whose bounds meet `box` [m, map frame] as the poses of the submaps stand,
  /// in order; conservative under rotation. Unplaced tiles meet none.
  [[nodiscard]] std::vector<std::size_t> tiles_in(const Box& box) const;
  /// Index of a tile; nothing if there is none.
  [[nodiscard]] std::optional<std::size_t> find(const TileKey& key, std::uint32_t submap = 0) const;

  /// The bytes of one segment, checked.
  /// Errors: ChecksumMismatch (with offset, tile key in the message), ArchiveDamaged (file is shorter),
  /// Unreadable.
  [[nodiscard]] Result<Bytes> read(const SegmentRef& segment) const;

  /// Of the content of a tile; read where the archive does not store its hashes. Errors: as read.
  [[nodiscard]] Result<ContentHash> hash(const TileRecord& tile) const;
  /// True if both are revisions of one opened file (see `at`): segments with equal places are equal.
  [[nodiscard]] bool shares_store(const MapArchive& other) const { return store_ == other.store_; }

  /// What the archive is read from: for those who hand its bytes on as they lie.
  [[nodiscard]] const TileStore& store() const { return *store_; }
  /// Bytes read from the store since opening, the opening included.
  [[nodiscard]] std::uint64_t bytes_read() const { return store_->bytes_read(); }
  /// Size of the file up to the end of the newest whole commit at opening.
  [[nodiscard]] std::uint64_t file_bytes() const { return file_bytes_; }
  /// Bytes after the newest whole commit at opening: an unfinished commit, of a writer at work or one that
  /// died.
  [[nodiscard]] std::uint64_t trailing_bytes() const { return trailing_bytes_; }
  /// True if those bytes end like a commit that was whole once: a newer revision was damaged.
  [[nodiscard]] bool lost_newest() const;

  /// Reads the whole file: all commits, all their segments and dead ranges. Any flipped bit is found.
  /// Errors: Unreadable. What is wrong with the bytes stands in the report.
  [[nodiscard]] Result<VerifyReport> verify() const;
  /// All revisions up to this one, the newest first. Errors: ArchiveDamaged, Unreadable.
  [[nodiscard]] Result<std::vector<RevisionInfo>> log() const;

 private:
  explicit MapArchive(std::shared_ptr<const TileStore> store) : store_(std::move(store)) {}
  [[nodiscard]] Status load(Commit commit, const DecodeLimits& limits);
  [[nodiscard]] std::string owner_of(const SegmentRef& segment) const;

  std::shared_ptr<const TileStore> store_;
  MapInfo info_;
  std::uint64_t revision_ = 0, record_offset_ = 0;
  std::int64_t timestamp_s_ = 0;
  std::uint64_t file_bytes_ = 0, trailing_bytes_ = 0, newest_offset_ = 0;
  std::vector<TileRecord> tiles_;
};

/// Verifies what stands at `path`, also if it cannot be opened: then the report's only finding says why.
/// Errors: NotFound, Unreadable, Empty, Malformed (not an archive), Unsupported.
[[nodiscard]] Result<VerifyReport> verify_archive(const std::string& path);

/// The revision of the archive at `path` that `text` means (`MapArchive::resolve`). Errors: as open;
/// NotFound.
[[nodiscard]] Result<std::uint64_t> resolve_revision(const std::string& path, const std::string& text);

/// "(x, y, z) of level l", with the submap if it is not the first.
[[nodiscard]] std::string tile_name(const TileRecord& tile);

}  // namespace mapcodec
