// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/tile_rescue.hpp"

#include <algorithm>
#include <set>

#include "mapcodec/base/crc32c.hpp"
#include "maps/metadata_codec.hpp"

namespace mapcodec {
namespace {

/// "" or what is wrong with the segments of a tile.
std::string damage_of(const TileStore& store, const TileRecord& tile) {
  for (const SegmentRef& s : tile.segments) {
    const auto bytes = store.read(s.offset, s.length);
    if (!bytes.ok()) return bytes.error().to_string();
    if (crc32c(*bytes) != s.crc)
      return make_error(ErrorCode::kChecksumMismatch, "a segment does not match its checksum", s.offset)
          .to_string();
  }
  return "";
}

struct Version {
  IndexEntry entry;
  std::uint64_t revision = 0;
};

/// Walks the commits before a revision, the oldest first, and keeps the last whole version of each wanted
/// tile.
class History {
 public:
  History(const TileStore& store, std::set<TileId, TileIdLess> wanted)
      : store_(store), wanted_(std::move(wanted)) {}

  void add(const Commit& commit) {
    if (commit.record.metadata_bytes > 0) {
      auto info = decode_metadata(commit.metadata());
      if (info.ok()) info_ = std::move(info).value();
    }
    if (!info_) return;
    const auto block = decode_index(commit.index(), context_of(commit, *info_));
    if (!block.ok()) return;
    if (!block->delta) versions.clear();
    for (const TileId& id : block->removed) versions.erase(id);
    for (const IndexEntry& entry : block->set) {
      const TileId id = id_of(entry.record);
      if (wanted_.contains(id) && damage_of(store_, entry.record).empty())
        versions.insert_or_assign(id, Version{entry, commit.record.revision});
    }
  }

  std::map<TileId, Version, TileIdLess> versions;

 private:
  const TileStore& store_;
  std::set<TileId, TileIdLess> wanted_;
  std::optional<MapInfo> info_;
};

/// Records of the commits before `commit` as far as the chain is whole, the oldest first.
std::vector<std::uint64_t> records_before(const TileStore& store, std::uint64_t offset) {
  std::vector<std::uint64_t> offsets;
  auto commit = read_commit(store, offset);
  while (commit.ok() && commit->record.previous != 0) {
    commit = read_previous(store, *commit);
    if (commit.ok()) offsets.push_back(commit->offset);
  }
  std::reverse(offsets.begin(), offsets.end());
  return offsets;
}

}  // namespace

Result<std::vector<LostTile>> rescue_tiles(const TileStore& store, ArchiveState& state) {
  std::map<TileId, std::string, TileIdLess> damaged;
  for (const IndexEntry& e : state.entries) {
    std::string damage = damage_of(store, e.record);
    if (!damage.empty()) damaged.emplace(id_of(e.record), std::move(damage));
  }
  std::vector<LostTile> replaced;
  if (damaged.empty()) return replaced;
  std::set<TileId, TileIdLess> wanted;
  for (const auto& [id, damage] : damaged) wanted.insert(id);
  History history(store, std::move(wanted));
  for (const std::uint64_t offset : records_before(store, state.offset)) {
    MAPCODEC_ASSIGN(const Commit commit, read_commit(store, offset));
    history.add(commit);
  }
  for (IndexEntry& e : state.entries) {
    const auto older = history.versions.find(id_of(e.record));
    if (older == history.versions.end()) continue;
    replaced.push_back({e.record.submap, e.record.key, e.record.points, state.record.revision,
                        damaged[older->first], older->second.revision});
    e = older->second.entry;
  }
  return replaced;
}

}  // namespace mapcodec
