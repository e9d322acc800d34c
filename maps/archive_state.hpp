// SPDX-License-Identifier: GPL-3.0-or-later
// A revision put together from its chain of commits: what readers and writers both start from.
#pragma once

#include <map>
#include <optional>

#include "maps/commit_record.hpp"
#include "maps/index_codec.hpp"

namespace mapcodec {

/// Most commits with a delta index in a row.
inline constexpr std::size_t kMaxDeltas = 256;

struct ArchiveState {
  CommitRecord record;       ///< of the revision
  std::uint64_t offset = 0;  ///< of its record
  MapInfo info;
  Bytes metadata;                   ///< the block that `info` came from
  std::vector<IndexEntry> entries;  ///< all tiles, in order, but for `changes`
  /// What deltas set, or removed, since `entries`: so that a long chain costs its changes, not all tiles each
  /// time. Empty after `load_state`.
  std::map<TileId, std::optional<IndexEntry>, TileIdLess> changes;
  std::uint64_t tiles = 0;              ///< with the changes
  std::uint64_t full_index_bytes = 0;   ///< of the full index in the chain
  std::uint64_t delta_index_bytes = 0;  ///< of the deltas after it, together
  std::uint64_t deltas = 0;             ///< their number
  bool hashes = false;                  ///< the newest index that has tiles stores hashes
};

/// Puts together the revision that `last` ends. Errors: ArchiveDamaged (with offset), LimitExceeded,
/// Unreadable.
[[nodiscard]] Result<ArchiveState> load_state(const TileStore& store, Commit last,
                                              const DecodeLimits& limits = {});

/// Turns the state of the previous commit (or an empty one) into that of `commit`. `info.input_points` stays
/// as decoded; the tiles are `entries` with `changes`. Errors: ArchiveDamaged (with offset), LimitExceeded.
[[nodiscard]] Status apply_commit(const Commit& commit, const DecodeLimits& limits, ArchiveState& state);

/// The commit before `commit`. Errors: ArchiveDamaged (missing, or its revision is not smaller).
[[nodiscard]] Result<Commit> read_previous(const TileStore& store, const Commit& commit);

/// The commit of `revision`, searched backwards from `last`. Errors: NotFound, ArchiveDamaged.
[[nodiscard]] Result<Commit> find_revision(const TileStore& store, Commit last, std::uint64_t revision);

/// What a commit's index is decoded in. @param info  of that commit.
[[nodiscard]] IndexContext context_of(const Commit& commit, const MapInfo& info);

/// Sum of the points of all tiles (wraps around).
[[nodiscard]] std::uint64_t total_points(const std::vector<IndexEntry>& entries);

/// `error` as ArchiveDamaged at `offset`; LimitExceeded and Unreadable stay what they are.
[[nodiscard]] Error as_damage(Error error, std::uint64_t offset);

}  // namespace mapcodec
