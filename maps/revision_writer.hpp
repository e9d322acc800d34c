// SPDX-License-Identifier: GPL-3.0-or-later
// Writes whole revisions, the oldest first, into a new archive: what compaction and repair share.
#pragma once

#include <map>
#include <vector>

#include "maps/archive_state.hpp"
#include "maps/compaction.hpp"

namespace mapcodec {

/// Copies what the revisions refer to; what two of them share is copied once.
class RevisionWriter {
 public:
  struct Settings {
    bool hashes = false;
    bool skip_damaged = false;  ///< leave damaged tiles out and list them, instead of failing
    TileFolder fold;
    std::function<bool()> stop;
  };
  /// @param source, out  must outlive this; `out` is empty.
  RevisionWriter(const TileStore& source, TileStore& out, Settings settings)
      : source_(source), out_(out), settings_(std::move(settings)) {}

  /// Writes `state` as the next commit under its own number and timestamp. @param last  publishes all.
  /// Errors: ChecksumMismatch, ArchiveDamaged (unless skipped), Unreadable, CannotWrite, Cancelled,
  /// LimitExceeded.
  [[nodiscard]] Status write(ArchiveState state, bool last);

  [[nodiscard]] const std::vector<LostTile>& lost() const { return lost_; }
  [[nodiscard]] std::uint64_t segments() const { return copied_.size(); }
  [[nodiscard]] std::uint64_t folded() const { return folded_.size(); }
  /// The tiles of the revision written last.
  [[nodiscard]] const std::vector<IndexEntry>& entries() const { return previous_; }

 private:
  struct Copied {
    SegmentRef ref;
    ContentHash hash;
  };
  using Place = std::pair<std::uint64_t, std::uint32_t>;  // of a segment in the source

  [[nodiscard]] Result<std::vector<IndexEntry>> copy_tiles(ArchiveState& state);
  [[nodiscard]] Status copy_tile(const MapInfo& info, IndexEntry& entry);
  [[nodiscard]] Result<bool> fold_tile(const MapInfo& info, IndexEntry& entry);
  [[nodiscard]] Result<Bytes> read(const TileRecord& tile, const SegmentRef& segment) const;
  [[nodiscard]] Result<Copied> copy_segment(const TileRecord& tile, const SegmentRef& segment);
  [[nodiscard]] Result<IndexEntry> write_folded(const MapInfo& info, const TileRecord& tile,
                                                const FoldedTile& folded);
  [[nodiscard]] bool lose(const TileRecord& tile, const Error& error, std::uint64_t revision);
  [[nodiscard]] IndexBlock make_block(const std::vector<IndexEntry>& entries) const;
  [[nodiscard]] Status write_head(const ArchiveState& state, const IndexBlock& block, bool last);

  const TileStore& source_;
  TileStore& out_;
  Settings settings_;
  std::map<Place, Copied> copied_;
  std::map<std::vector<std::uint64_t>, IndexEntry> folded_;  // by the offsets of the segments in the source
  std::map<std::uint64_t, bool> bad_;                        // offsets of damaged segments
  std::vector<LostTile> lost_;
  std::vector<IndexEntry> previous_;
  Bytes metadata_;
  std::uint64_t begin_ = 0;    // of the commit's area
  std::uint64_t record_ = 0;   // offset of the record before
  std::uint64_t changes_ = 0;  // in the deltas since the last full index
  std::uint64_t deltas_ = 0;
};

}  // namespace mapcodec
