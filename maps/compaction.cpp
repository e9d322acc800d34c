// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/compaction.hpp"

#include <unistd.h>

#include <filesystem>
#include <set>

#include "maps/file_store.hpp"
#include "maps/revision_writer.hpp"

namespace mapcodec {
namespace {

/// Where the revisions to keep lie, the oldest first.
struct Kept {
  std::vector<std::uint64_t> records;
  std::uint64_t revisions = 0;       // of the whole archive
  std::set<std::uint64_t> segments;  // of the kept ones: their offsets
};

Result<Kept> choose_kept(const TileStore& store, Commit commit, const MapInfo& newest,
                         std::uint64_t keep_last) {
  std::set<std::uint64_t> named;
  for (const Snapshot& s : newest.snapshots) named.insert(s.revision);
  Kept kept;
  for (;;) {
    if (kept.revisions++ < std::max<std::uint64_t>(keep_last, 1) || named.contains(commit.record.revision))
      kept.records.insert(kept.records.begin(), commit.offset);
    named.erase(commit.record.revision);
    if (commit.record.previous == 0) break;
    MAPCODEC_ASSIGN(commit, read_previous(store, commit));
  }
  if (named.empty()) return kept;
  return make_error(ErrorCode::kArchiveDamaged,
                    "a snapshot names revision " + std::to_string(*named.begin()) + ", which is not there");
}

Status write_all(const TileStore& source, RevisionWriter& writer, Kept& kept) {
  for (const std::uint64_t offset : kept.records) {
    MAPCODEC_ASSIGN(Commit commit, read_commit(source, offset));
    MAPCODEC_ASSIGN(ArchiveState state, load_state(source, std::move(commit)));
    for (const IndexEntry& e : state.entries) {
      for (const SegmentRef& s : e.record.segments) kept.segments.insert(s.offset);
    }
    MAPCODEC_TRY(writer.write(std::move(state), offset == kept.records.back()));
  }
  return {};
}

/// What a symbolic link names is replaced, not the link.
Result<std::string> real_path(const std::string& path) {
  std::error_code error;
  const auto real = std::filesystem::canonical(path, error);
  if (!error) return real.string();
  return make_error(ErrorCode::kNotFound, "cannot be opened: " + error.message());
}

Result<CompactReport> compact(const TileStore& source, TileStore& out, const CompactSettings& settings) {
  MAPCODEC_ASSIGN(Commit last, find_last_commit(source));
  CompactReport report;
  MAPCODEC_ASSIGN(report.bytes_before, source.end());
  if (report.bytes_before > last.end() && ends_like_commit(source)) {
    return make_error(ErrorCode::kArchiveDamaged, "ends with a damaged commit, which compaction would lose",
                      last.end());
  }
  MAPCODEC_ASSIGN(const ArchiveState newest, load_state(source, last));
  MAPCODEC_ASSIGN(Kept kept, choose_kept(source, std::move(last), newest.info, settings.keep_last));
  report.hashes = settings.hashes.value_or(newest.hashes);
  RevisionWriter writer(source, out, {report.hashes, false, settings.fold, settings.stop});
  MAPCODEC_TRY(write_all(source, writer, kept));
  MAPCODEC_ASSIGN(report.bytes_after, out.end());
  report.revisions_before = kept.revisions;
  report.revisions_after = kept.records.size();
  report.segments_before = kept.segments.size();
  report.segments_after = writer.segments();
  report.folded_tiles = writer.folded();
  report.tiles = newest.entries.size();
  return report;
}

}  // namespace

Result<CompactReport> compact_archive(const std::string& path, const CompactSettings& settings) {
  MAPCODEC_ASSIGN(const std::string real, real_path(path));
  {  // says what is wrong with the file itself, before anything is locked
    MAPCODEC_ASSIGN(const auto probe, FileStore::open_for_reading(real));
    MAPCODEC_TRY(check_header(*probe));
    if (::access(real.c_str(), W_OK) != 0)  // replacing it would go behind its protection
      return make_error(ErrorCode::kCannotWrite, "is read-only");
  }
  // Locks the archive; only then what it holds can no longer change.
  MAPCODEC_ASSIGN(const std::unique_ptr<FileStore> out, FileStore::create(real, true));
  MAPCODEC_ASSIGN(const std::unique_ptr<FileStore> source, FileStore::open_for_reading(real));
  return compact(*source, *out, settings);
}

}  // namespace mapcodec
