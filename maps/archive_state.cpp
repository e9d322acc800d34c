// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/archive_state.hpp"

#include <algorithm>

#include "maps/metadata_codec.hpp"

namespace mapcodec {
namespace {

Error damaged(const std::string& what, std::uint64_t offset) {
  return make_error(ErrorCode::kArchiveDamaged, what, offset);
}

/// The commits that make up a revision, the newest first: back to one with a full index and its own metadata.
Result<std::vector<Commit>> read_chain(const TileStore& store, Commit last) {
  std::vector<Commit> chain;
  chain.push_back(std::move(last));
  for (;;) {
    const Commit& commit = chain.back();
    const auto head = decode_index_head(commit.index());
    if (!head.ok()) return as_damage(head.error(), commit.segments_end());
    if (!head->delta) return chain;
    if (chain.size() > kMaxDeltas)
      return damaged("too many changes without a full index", commit.segments_end());
    MAPCODEC_ASSIGN(Commit previous, read_previous(store, commit));
    chain.push_back(std::move(previous));
  }
}

Status decode_info(const Commit& commit, ArchiveState& state) {
  if (commit.record.metadata_bytes == 0 && !state.metadata.empty()) return {};
  auto info = decode_metadata(commit.metadata());
  if (!info.ok()) return as_damage(info.error(), commit.segments_end() + commit.record.index_bytes);
  state.info = *std::move(info);
  const ByteSpan block = commit.metadata();
  state.metadata.assign(block.begin(), block.end());
  return {};
}

/// Merges two ordered lists; an entry of `set` replaces its namesake.
std::vector<IndexEntry> merge(std::vector<IndexEntry> old, std::vector<IndexEntry> set) {
  std::vector<IndexEntry> out;
  out.reserve(old.size() + set.size());
  auto a = old.begin();
  const TileIdLess less;
  for (IndexEntry& entry : set) {
    for (; a != old.end() && less(id_of(a->record), id_of(entry.record)); ++a) out.push_back(std::move(*a));
    if (a != old.end() && id_of(a->record) == id_of(entry.record)) ++a;
    out.push_back(std::move(entry));
  }
  std::move(a, old.end(), std::back_inserter(out));
  return out;
}

Status remove_all(std::vector<IndexEntry>& entries, const std::vector<TileId>& removed,
                  std::uint64_t offset) {
  const std::size_t before = entries.size();
  std::erase_if(entries, [&](const IndexEntry& e) {
    return std::binary_search(removed.begin(), removed.end(), id_of(e.record), TileIdLess());
  });
  if (before - entries.size() != removed.size())
    return damaged("the index removes a tile that is not there", offset);
  return {};
}

}  // namespace

Error as_damage(Error error, std::uint64_t offset) {
  if (error.code == ErrorCode::kLimitExceeded || error.code == ErrorCode::kUnreadable) return error;
  return make_error(ErrorCode::kArchiveDamaged, error.message, offset + error.offset.value_or(0));
}

Result<Commit> read_previous(const TileStore& store, const Commit& commit) {
  if (commit.record.previous == 0)
    return damaged("a commit needs one before it, but is the first", commit.offset);
  MAPCODEC_ASSIGN(Commit previous, read_commit(store, commit.record.previous));
  if (previous.record.waypoint || previous.record.revision >= commit.record.revision) {
    return damaged("the chain of commits is broken", previous.offset);
  }
  return previous;
}

Result<Commit> find_revision(const TileStore& store, Commit last, std::uint64_t revision) {
  const auto none = [&] {
    return make_error(ErrorCode::kNotFound, "has no revision " + std::to_string(revision) +
                                                " (its newest is " + std::to_string(last.record.revision) +
                                                ")");
  };
  if (revision > last.record.revision) return none();
  Commit commit = last;
  while (commit.record.revision > revision && commit.record.previous != 0) {
    MAPCODEC_ASSIGN(commit, read_previous(store, commit));
  }
  if (commit.record.revision != revision) return none();
  return commit;
}

Status apply_commit(const Commit& commit, const DecodeLimits& limits, ArchiveState& state) {
  MAPCODEC_TRY(decode_info(commit, state));
  auto block = decode_index(commit.index(), context_of(commit, state.info), limits);
  if (!block.ok()) return as_damage(block.error(), commit.segments_end());
  if (block->delta) {
    MAPCODEC_TRY(remove_all(state.entries, block->removed, commit.segments_end()));
    state.entries = merge(std::move(state.entries), std::move(block->set));
    state.delta_index_bytes += commit.record.index_bytes;
    ++state.deltas;
  } else {
    state.entries = std::move(block->set);
    state.full_index_bytes = commit.record.index_bytes;
    state.delta_index_bytes = state.deltas = 0;
  }
  if (state.entries.size() != block->tiles)
    return damaged("the index holds another number of tiles than it says", commit.segments_end());
  state.record = commit.record;
  state.offset = commit.offset;
  return {};
}

Result<ArchiveState> load_state(const TileStore& store, Commit last, const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const std::vector<Commit> chain, read_chain(store, std::move(last)));
  ArchiveState state;
  for (auto commit = chain.rbegin(); commit != chain.rend(); ++commit)
    MAPCODEC_TRY(apply_commit(*commit, limits, state));
  state.info.input_points += total_points(state.entries);
  return state;
}

IndexContext context_of(const Commit& commit, const MapInfo& info) {
  return {info.origin, info.tile_size_m, info.achieved, commit.segments_begin(), commit.segments_end()};
}

std::uint64_t total_points(const std::vector<IndexEntry>& entries) {
  std::uint64_t sum = 0;
  for (const IndexEntry& e : entries) sum += e.record.points;
  return sum;
}

}  // namespace mapcodec
