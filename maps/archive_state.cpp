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

bool holds(const ArchiveState& state, const TileId& id) {
  if (const auto at = state.changes.find(id); at != state.changes.end()) return at->second.has_value();
  const auto at =
      std::lower_bound(state.entries.begin(), state.entries.end(), id,
                       [](const IndexEntry& e, const TileId& i) { return TileIdLess()(id_of(e.record), i); });
  return at != state.entries.end() && id_of(at->record) == id;
}

Status apply_delta(IndexBlock block, std::uint64_t offset, ArchiveState& state) {
  for (const TileId& id : block.removed) {
    if (!holds(state, id)) return damaged("the index removes a tile that is not there", offset);
    state.changes[id] = std::nullopt;
    --state.tiles;
  }
  for (IndexEntry& entry : block.set) {
    const TileId id = id_of(entry.record);
    state.tiles += holds(state, id) ? 0 : 1;
    state.changes[id] = std::move(entry);
  }
  return {};
}

/// Takes the changes into the list.
void settle(ArchiveState& state) {
  if (state.changes.empty()) return;
  std::vector<IndexEntry> out;
  out.reserve(state.tiles);
  auto a = state.entries.begin();
  const TileIdLess less;
  for (auto& [id, entry] : state.changes) {
    for (; a != state.entries.end() && less(id_of(a->record), id); ++a) out.push_back(std::move(*a));
    if (a != state.entries.end() && id_of(a->record) == id) ++a;
    if (entry) out.push_back(std::move(*entry));
  }
  std::move(a, state.entries.end(), std::back_inserter(out));
  state.entries = std::move(out);
  state.changes.clear();
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
  if (!block->set.empty()) state.hashes = block->hashes;
  const std::uint64_t tiles = block->tiles;
  if (block->delta) {
    MAPCODEC_TRY(apply_delta(std::move(block).value(), commit.segments_end(), state));
    state.delta_index_bytes += commit.record.index_bytes;
    ++state.deltas;
  } else {
    state.changes.clear();
    state.entries = std::move(block->set);
    state.tiles = state.entries.size();
    state.full_index_bytes = commit.record.index_bytes;
    state.delta_index_bytes = state.deltas = 0;
  }
  if (state.tiles != tiles)
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
  settle(state);
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
