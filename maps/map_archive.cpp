// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/map_archive.hpp"

#include <algorithm>
#include <charconv>

#include "mapcodec/base/crc32c.hpp"
#include "maps/archive_state.hpp"
#include "maps/store_schemes.hpp"
#include "maps/submap_pose.hpp"

namespace mapcodec {

Result<MapArchive> MapArchive::open(const std::string& path, std::optional<std::uint64_t> revision,
                                    const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(std::unique_ptr<TileStore> store, open_store(path));
  return open(std::move(store), revision, limits);
}

Result<MapArchive> MapArchive::open(std::unique_ptr<TileStore> store, std::optional<std::uint64_t> revision,
                                    const DecodeLimits& limits) {
  MapArchive archive(std::move(store));
  MAPCODEC_ASSIGN(const std::uint64_t end, archive.store_->end());
  MAPCODEC_ASSIGN(Commit commit, find_last_commit(*archive.store_));
  archive.newest_offset_ = commit.offset;
  archive.file_bytes_ = commit.end();
  archive.trailing_bytes_ =
      end > commit.end() ? end - commit.end() : 0;  // a writer may have grown the file since
  if (revision) {
    MAPCODEC_ASSIGN(commit, find_revision(*archive.store_, std::move(commit), *revision));
  }
  MAPCODEC_TRY(archive.load(std::move(commit), limits));
  return archive;
}

Status MapArchive::load(Commit commit, const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(ArchiveState state, load_state(*store_, std::move(commit), limits));
  info_ = std::move(state.info);
  revision_ = state.record.revision;
  timestamp_s_ = state.record.timestamp_s;
  record_offset_ = state.offset;
  tiles_.reserve(state.entries.size());
  for (IndexEntry& entry : state.entries) tiles_.push_back(std::move(entry.record));
  return {};
}

Result<MapArchive> MapArchive::at(std::uint64_t revision, const DecodeLimits& limits) const {
  MapArchive archive(store_);
  archive.newest_offset_ = newest_offset_;
  archive.file_bytes_ = file_bytes_;
  archive.trailing_bytes_ = trailing_bytes_;
  MAPCODEC_ASSIGN(Commit newest, read_commit(*store_, newest_offset_));
  MAPCODEC_ASSIGN(Commit commit, find_revision(*store_, std::move(newest), revision));
  MAPCODEC_TRY(archive.load(std::move(commit), limits));
  return archive;
}

Result<std::uint64_t> MapArchive::resolve(const std::string& text) const {
  std::string names;
  for (const Snapshot& s : info_.snapshots) {
    if (s.name == text) return s.revision;
    names += (names.empty() ? "" : ", ") + s.name;
  }
  std::uint64_t number = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (!text.empty() && text.size() <= 10 && error == std::errc() && stop == text.data() + text.size())
    return number;
  return make_error(
      ErrorCode::kNotFound,
      "has no snapshot '" + text + "' (" + (names.empty() ? "there are none" : "there are: " + names) + ")");
}

bool MapArchive::lost_newest() const {
  return trailing_bytes_ > 0 && ends_like_commit(*store_);
}

std::vector<std::size_t> MapArchive::tiles_in(const Box& box) const {
  std::vector<std::size_t> found;
  PosedQuery query(info_, box);
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    if (query.meets(tiles_[i])) found.push_back(i);
  }
  return found;
}

Result<ContentHash> MapArchive::hash(const TileRecord& tile) const {
  if (!tile.hashes.empty()) return hash_tile(tile.codec, tile.hashes);
  std::vector<ContentHash> hashes;
  for (const SegmentRef& segment : tile.segments) {
    MAPCODEC_ASSIGN(const Bytes bytes, read(segment));
    hashes.push_back(hash_bytes(bytes));
  }
  return hash_tile(tile.codec, hashes);
}

std::optional<std::size_t> MapArchive::find(const TileKey& key, std::uint32_t submap) const {
  const auto at =
      std::lower_bound(tiles_.begin(), tiles_.end(), key, [submap](const TileRecord& t, const TileKey& k) {
        return compare_tiles(t.submap, t.key, submap, k) < 0;
      });
  if (at == tiles_.end() || at->key != key || at->submap != submap) return std::nullopt;
  return static_cast<std::size_t>(at - tiles_.begin());
}

std::string MapArchive::owner_of(const SegmentRef& segment) const {
  for (const TileRecord& tile : tiles_) {
    if (std::find(tile.segments.begin(), tile.segments.end(), segment) != tile.segments.end())
      return "tile " + tile_name(tile);
  }
  return "a segment of no tile";
}

Result<Bytes> MapArchive::read(const SegmentRef& segment) const {
  auto bytes = store_->read(segment.offset, segment.length);
  if (!bytes.ok() && bytes.error().code == ErrorCode::kTruncated) {
    return make_error(ErrorCode::kArchiveDamaged, "the file ends before " + owner_of(segment),
                      segment.offset);
  }
  if (bytes.ok() && crc32c(*bytes) != segment.crc) {
    return make_error(ErrorCode::kChecksumMismatch, owner_of(segment) + " does not match its checksum",
                      segment.offset);
  }
  return bytes;
}

Result<std::vector<RevisionInfo>> MapArchive::log() const {
  std::vector<RevisionInfo> revisions;
  for (std::uint64_t offset = record_offset_; offset != 0;) {
    MAPCODEC_ASSIGN(const Commit commit, read_commit(*store_, offset));
    const auto head = decode_index_head(commit.index());
    if (!head.ok()) return as_damage(head.error(), commit.segments_end());
    revisions.push_back({commit.record.revision, commit.record.timestamp_s, head->tiles, commit.offset,
                         commit.end() - commit.segments_begin()});
    offset = commit.record.previous;
  }
  return revisions;
}

Result<std::uint64_t> resolve_revision(const std::string& path, const std::string& text) {
  MAPCODEC_ASSIGN(const MapArchive newest, MapArchive::open(path));
  return newest.resolve(text);
}

std::string tile_name(const TileRecord& tile) {
  if (tile.key.is_unplaced()) return "of unplaced points";
  const std::string at = "(" + std::to_string(tile.key.x) + ", " + std::to_string(tile.key.y) + ", " +
                         std::to_string(tile.key.z) + ") of level " + std::to_string(tile.key.level);
  return tile.submap == 0 ? at : at + " in submap " + std::to_string(tile.submap);
}

}  // namespace mapcodec
