// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "mapcodec/base/crc32c.hpp"
#include "maps/archive_state.hpp"
#include "maps/file_store.hpp"
#include "maps/map_archive.hpp"
#include "maps/metadata_codec.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kChunk = std::uint64_t{1} << 22;

bool by_offset(const SegmentRef& a, const SegmentRef& b) {
  return a.offset != b.offset ? a.offset < b.offset : a.length < b.length;
}

std::vector<SegmentRef> segments_of(const std::vector<IndexEntry>& entries) {
  std::vector<SegmentRef> segments;
  for (const IndexEntry& e : entries)
    segments.insert(segments.end(), e.record.segments.begin(), e.record.segments.end());
  return segments;
}

/// Walks the commits from the newest to the first and checks every byte between header and end.
class Verifier {
 public:
  explicit Verifier(const TileStore& store) : store_(store) {}

  Result<VerifyReport> run(const std::vector<TileRecord>& live) {
    MAPCODEC_ASSIGN(report_.file_bytes, store_.end());
    MAPCODEC_TRY(check_commits());
    for (const TileRecord& tile : live) check_live(tile);
    for (const SegmentRef& s : known_) report_.dead_bytes += s.length;
    report_.dead_bytes -= std::min(report_.dead_bytes, report_.live_bytes);
    return std::move(report_);
  }

 private:
  void found(std::string what, std::uint64_t offset) {
    report_.findings.push_back(make_error(ErrorCode::kArchiveDamaged, std::move(what), offset));
  }

  Status check_commits() {
    auto last = find_last_commit(store_);
    if (!last.ok()) return note(last.error());
    report_.trailing_bytes = report_.file_bytes - std::min(report_.file_bytes, last->end());
    if (report_.trailing_bytes > 0) {
      report_.lost_newest = ends_like_commit(store_);
      found("bytes after the last whole commit", last->end());
    }
    report_.checked_bytes += kHeaderBytes;
    MAPCODEC_ASSIGN(std::vector<std::uint64_t> offsets, list_commits(*std::move(last)));
    ArchiveState state;
    for (auto offset = offsets.rbegin(); offset != offsets.rend(); ++offset) {
      auto commit = read_commit(store_, *offset);
      if (!commit.ok()) return note(commit.error());
      MAPCODEC_TRY(check_commit(*commit, state));
    }
    std::sort(known_.begin(), known_.end(), by_offset);
    return {};
  }

  /// Offsets of the records, the newest first; a broken chain is noted and ends the list.
  Result<std::vector<std::uint64_t>> list_commits(Commit commit) {
    std::vector<std::uint64_t> offsets{commit.offset};
    while (commit.record.previous != 0) {
      auto previous = read_previous(store_, commit);
      if (!previous.ok()) {
        MAPCODEC_TRY(note(previous.error()));
        break;
      }
      commit = *std::move(previous);
      offsets.push_back(commit.offset);
    }
    return offsets;
  }

  /// What is wrong with the bytes is a finding; that they cannot be read is an error.
  Status note(const Error& error) {
    if (error.code == ErrorCode::kUnreadable) return error;
    report_.findings.push_back(error);
    return {};
  }

  Status check_commit(const Commit& commit, ArchiveState& state) {
    ++report_.revisions;
    report_.checked_bytes += commit.record.block_bytes() + kRecordBytes;
    if (const Status applied = apply_commit(commit, {}, state); !applied.ok()) return note(applied.error());
    auto block = decode_index(commit.index(), context_of(commit, state.info));
    if (!block.ok()) return note(as_damage(block.error(), commit.segments_end()));
    return check_area(commit, segments_of(block->set), block->dead);
  }

  /// The commit's own segments and dead ranges must cover its area, without gap or overlap.
  Status check_area(const Commit& commit, std::vector<SegmentRef> ranges,
                    const std::vector<SegmentRef>& dead) {
    std::erase_if(ranges, [&](const SegmentRef& s) { return s.offset < commit.segments_begin(); });
    report_.segments += ranges.size();
    ranges.insert(ranges.end(), dead.begin(), dead.end());
    std::sort(ranges.begin(), ranges.end(), by_offset);
    std::uint64_t expected = commit.segments_begin();
    for (const SegmentRef& range : ranges) {
      if (range.offset != expected)
        found(range.offset > expected ? "bytes that belong to nothing" : "two tiles overlap",
              std::min(expected, range.offset));
      expected = std::max(expected, range.offset + range.length);
      MAPCODEC_TRY(check_range(range));
    }
    if (expected < commit.segments_end()) found("bytes that belong to nothing", expected);
    known_.insert(known_.end(), ranges.begin(), ranges.end());
    return {};
  }

  Status check_range(const SegmentRef& range) {
    std::uint32_t crc = 0;
    for (std::uint64_t done = 0; done < range.length;) {
      const std::uint64_t n = std::min<std::uint64_t>(kChunk, range.length - done);
      auto bytes = store_.read(range.offset + done, n);
      if (!bytes.ok()) return note(bytes.error());
      crc = crc32c(*bytes, crc);
      done += n;
    }
    if (crc != range.crc) {
      report_.findings.push_back(
          make_error(ErrorCode::kChecksumMismatch, "a segment does not match its checksum", range.offset));
    } else {
      report_.checked_bytes += range.length;
    }
    return {};
  }

  void check_live(const TileRecord& tile) {
    for (const SegmentRef& s : tile.segments) {
      report_.live_bytes += s.length;
      const auto at = std::lower_bound(known_.begin(), known_.end(), s, by_offset);
      if (at == known_.end() || *at != s)
        found("tile " + tile_name(tile) + " refers to bytes that no commit wrote", s.offset);
    }
  }

  const TileStore& store_;
  VerifyReport report_;
  std::vector<SegmentRef> known_;  // of all commits
};

}  // namespace

Result<VerifyReport> MapArchive::verify() const {
  return Verifier(*store_).run(tiles_);
}

Result<VerifyReport> verify_archive(const std::string& path) {
  auto archive = MapArchive::open(path);
  if (archive.ok()) return archive->verify();
  const Error& error = archive.error();
  if (error.code != ErrorCode::kArchiveDamaged) return error;
  VerifyReport report;
  report.findings.push_back(error);
  return report;
}

}  // namespace mapcodec
