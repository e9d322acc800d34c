// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <filesystem>

#include "maps/compaction.hpp"
#include "maps/file_store.hpp"
#include "maps/flip_correction.hpp"
#include "maps/map_archive.hpp"
#include "maps/metadata_codec.hpp"
#include "maps/revision_writer.hpp"
#include "maps/store_schemes.hpp"
#include "maps/tile_rescue.hpp"

namespace mapcodec {
namespace {

std::string revision_name(std::uint64_t revision) {
  return "revision " + std::to_string(revision);
}

/// Finds what can be put together, the newest first.
class Salvage {
 public:
  Salvage(const TileStore& store, RepairReport& report) : store_(store), report_(report) {}

  /// States to save, the oldest first. Errors: ArchiveDamaged, Unreadable.
  Result<std::vector<ArchiveState>> run() {
    MAPCODEC_ASSIGN(const std::uint64_t size, store_.end());
    std::uint64_t end = size;
    while (end > kHeaderBytes) {
      auto commit = find_commit_before(store_, end);
      if (!commit.ok()) break;
      if (end == size && size > commit->end() && ends_like_commit(store_))
        note("a revision after revision " + std::to_string(commit->record.revision) + " is damaged");
      end = commit->offset;
      seen_.push_back(*commit);
      auto state = load_state(store_, std::move(commit).value());
      if (state.ok()) return with_snapshots(std::move(state).value());
      note(revision_name(seen_.back().record.revision) +
           " cannot be put together: " + state.error().to_string());
    }
    if (!seen_.empty()) return left_over();
    return make_error(ErrorCode::kArchiveDamaged, "holds no commit that could be saved");
  }

 private:
  void note(std::string text) { report_.notes.push_back(std::move(text)); }

  Result<std::vector<ArchiveState>> with_snapshots(ArchiveState newest) {
    std::vector<ArchiveState> states;
    std::vector<Snapshot> kept;
    for (const Snapshot& s : newest.info.snapshots) {
      auto state = load(newest, s.revision);
      if (!state.ok()) {
        note("snapshot '" + s.name + "' is lost: " + state.error().to_string());
        continue;
      }
      kept.push_back(s);
      const bool known = s.revision == newest.record.revision ||
                         std::any_of(states.begin(), states.end(), [&](const ArchiveState& other) {
                           return other.record.revision == s.revision;
                         });
      if (!known) states.push_back(std::move(state).value());
    }
    newest.info.snapshots = std::move(kept);
    states.push_back(std::move(newest));
    std::sort(states.begin(), states.end(), [](const ArchiveState& a, const ArchiveState& b) {
      return a.record.revision < b.record.revision;
    });
    return states;
  }

  Result<ArchiveState> load(const ArchiveState& newest, std::uint64_t revision) const {
    MAPCODEC_ASSIGN(Commit last, read_commit(store_, newest.offset));
    MAPCODEC_ASSIGN(Commit commit, find_revision(store_, std::move(last), revision));
    return load_state(store_, std::move(commit));
  }

  /// No revision is whole: what the changes say whose beginning is lost.
  Result<std::vector<ArchiveState>> left_over() {
    const auto described =
        std::find_if(seen_.begin(), seen_.end(), [](const Commit& c) { return c.record.metadata_bytes > 0; });
    if (described == seen_.end())
      return make_error(ErrorCode::kArchiveDamaged,
                        "the facts about the map are damaged, no tile can be read");
    std::vector<ArchiveState> states(1);
    ArchiveState& state = states.front();
    MAPCODEC_ASSIGN(state.info, decode_metadata(described->metadata()));
    std::uint64_t tiles = 0;
    std::map<TileId, IndexEntry, TileIdLess> entries;
    for (auto commit = seen_.rbegin(); commit != seen_.rend(); ++commit) {
      const auto block = decode_index(commit->index(), context_of(*commit, state.info));
      if (!block.ok()) continue;
      for (const TileId& id : block->removed) entries.erase(id);
      for (const IndexEntry& e : block->set) entries.insert_or_assign(id_of(e.record), e);
      tiles = block->tiles;
    }
    for (auto& [id, entry] : entries) state.entries.push_back(std::move(entry));
    state.record = seen_.front().record;
    state.info.snapshots.clear();
    state.info.input_points += total_points(state.entries);
    note(std::to_string(tiles - std::min<std::uint64_t>(tiles, entries.size())) +
         " tiles are lost with the index that lists them");
    return states;
  }

  const TileStore& store_;
  RepairReport& report_;
  std::vector<Commit> seen_;  // whole commits, the newest first
};

Result<RepairReport> repair(const TileStore& store, TileStore& out, RepairReport report) {
  MAPCODEC_ASSIGN(report.bytes_before, store.end());
  MAPCODEC_ASSIGN(std::vector<ArchiveState> states, Salvage(store, report).run());
  report.revision = states.back().record.revision;
  const std::uint64_t points = total_points(states.back().entries);
  MAPCODEC_ASSIGN(report.lost, rescue_tiles(store, states.back()));
  RevisionWriter writer(store, out, {states.back().hashes, true, {}, {}});
  for (std::size_t i = 0; i < states.size(); ++i)
    MAPCODEC_TRY(writer.write(std::move(states[i]), i + 1 == states.size()));
  report.lost.insert(report.lost.end(), writer.lost().begin(), writer.lost().end());
  report.tiles_saved = writer.entries().size();
  report.points_saved = total_points(writer.entries());
  report.points_lost = points - std::min(points, report.points_saved);
  MAPCODEC_ASSIGN(report.bytes_after, out.end());
  return report;
}

std::string byte_name(std::uint64_t offset) {
  return "the byte at " + std::to_string(offset);
}

/// The header is 8 bytes without a checksum of their own: that of any commit shows whether they are damaged.
void correct_header(CorrectedStore& store, RepairReport& report) {
  const auto end = store.end();
  const auto stored = store.read(0, kHeaderBytes);
  if (!end.ok() || !stored.ok() || find_commit_before(store, *end).ok()) return;
  CorrectedStore tried = store;
  const auto header = archive_header();
  for (std::size_t i = 0; i < kHeaderBytes; ++i) {
    const auto flip = static_cast<std::uint8_t>((*stored)[i] ^ header[i]);
    if (flip != 0) tried.add({i, flip});
  }
  const bool whole = find_commit_before(tried, *end).ok() ||
                     (*end > kRecordBytes && correct_commit(tried, *end - kRecordBytes).has_value());
  if (!whole) return;
  store.replace_corrections(tried);
  if (*stored != Bytes(header.begin(), header.end())) report.corrected.push_back("the header");
}

/// Commits that a single wrong byte made unreadable: the last one, and those that the chain leads to.
void correct_commits(CorrectedStore& store, RepairReport& report) {
  const auto end = store.end();
  if (!end.ok()) return;
  const auto correct = [&](std::uint64_t offset) {
    const auto correction = correct_commit(store, offset);
    if (!correction) return false;
    store.add(*correction);
    report.corrected.push_back(byte_name(correction->offset));
    return true;
  };
  if (ends_like_commit(store)) correct(*end - kRecordBytes);
  auto commit = find_commit_before(store, *end);
  while (commit.ok() && commit->record.previous != 0) {
    auto previous = read_previous(store, *commit);
    if (!previous.ok() && correct(commit->record.previous)) previous = read_previous(store, *commit);
    commit = std::move(previous);
  }
}

Status check_output(const std::string& path, const std::string& output) {
  std::error_code error;
  if (!std::filesystem::equivalent(path, output, error) || error) return {};
  return make_error(ErrorCode::kCannotWrite, "is the damaged archive itself, which repair never touches");
}

}  // namespace

Result<RepairReport> repair_archive(const TileStore& store, TileStore& out) {
  RepairReport report;
  CorrectedStore corrected(store);
  correct_header(corrected, report);
  MAPCODEC_TRY(check_header(corrected));
  correct_commits(corrected, report);
  return repair(corrected, out, std::move(report));
}

Result<RepairReport> repair_archive(const std::string& path, const std::string& output, bool overwrite) {
  MAPCODEC_ASSIGN(const std::unique_ptr<TileStore> store, open_store(path));
  MAPCODEC_TRY(check_output(path, output));
  MAPCODEC_ASSIGN(const std::unique_ptr<FileStore> out, FileStore::create(output, overwrite));
  return repair_archive(*store, *out);
}

}  // namespace mapcodec
