// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/writer_state.hpp"

#include <algorithm>
#include <limits>

#include "maps/metadata_codec.hpp"

namespace mapcodec {
namespace {

constexpr std::int64_t kMaxTimestamp = (std::int64_t{1} << 40) - 1;

Error invalid(const std::string& what) {
  return make_error(ErrorCode::kInvalidArgument, what);
}

bool is_placed_well(const TileKey& key) {
  return key.is_unplaced() ? key == TileKey::unplaced() : key.level <= kMaxTileLevel;
}

}  // namespace

void WriterState::resume(ArchiveState state) {
  points = total_points(state.entries);
  for (IndexEntry& entry : state.entries) {
    const TileId id = id_of(entry.record);
    entries.emplace_hint(entries.end(), id, std::move(entry));
  }
  state.entries.clear();
  info = state.info;
  hashes = state.hashes;
  begin = waypoint = state.offset + kRecordBytes;
  last = std::move(state);
}

Result<IndexEntry> WriterState::make_entry(const TileId& id, std::uint64_t tile_points, const Box& bounds,
                                           const TileErrors& errors) const {
  if (!is_placed_well(id.key)) return invalid("the tile's level is out of range");
  if (!is_valid(errors)) return invalid("an error of the tile is negative or not finite");
  const auto code = encode_bounds(bounds, id.key, info.origin, info.tile_size_m);
  if (!code) return invalid("the tile's bounds are not finite or far outside its cube");
  IndexEntry entry{{id.key, id.submap, 0, tile_points, {}, errors, {}, {}}, *code};
  entry.record.bounds = decode_bounds(*code, id.key, info.origin, info.tile_size_m);
  return entry;
}

Status WriterState::write_segment(IndexEntry& entry, ByteSpan bytes) {
  if (bytes.empty() || bytes.size() > kMaxSegmentBytes) return invalid("a tile needs 1 byte to 1 GiB");
  MAPCODEC_ASSIGN(const SegmentRef segment, store->append(bytes));
  TileRecord& record = entry.record;
  if (record.hashes.size() == record.segments.size()) record.hashes.push_back(hash_bytes(bytes));
  record.segments.push_back(segment);
  const std::uint64_t end = segment.offset + segment.length;
  return last.record.revision > 0 && end - waypoint >= kWaypointEvery ? write_waypoint() : Status();
}

Status WriterState::write_waypoint() {
  MAPCODEC_ASSIGN(const std::uint64_t offset, store->end());
  CommitRecord record;
  record.waypoint = true;
  record.previous = last.offset;
  record.revision = last.record.revision;
  MAPCODEC_ASSIGN(const SegmentRef written, store->append(write_record(record, offset, {})));
  dead.push_back(written);
  waypoint = offset + kRecordBytes;
  return {};
}

/// What this commit wrote for a tile that it then replaced or removed must still be accounted for.
void WriterState::bury(const IndexEntry& entry) {
  std::copy_if(entry.record.segments.begin(), entry.record.segments.end(), std::back_inserter(dead),
               [this](const SegmentRef& s) { return s.offset >= begin; });
}

void WriterState::put(const TileId& id, IndexEntry entry) {
  touch(id);
  const auto [at, fresh] = entries.try_emplace(id);
  points += entry.record.points - at->second.record.points;
  // Segments that the new entry goes on using are not dead.
  std::erase_if(at->second.record.segments, [&](const SegmentRef& s) {
    return std::find(entry.record.segments.begin(), entry.record.segments.end(), s) !=
           entry.record.segments.end();
  });
  if (!fresh) bury(at->second);
  at->second = std::move(entry);
}

void WriterState::erase(std::map<TileId, IndexEntry, TileIdLess>::iterator at) {
  touch(at->first);
  bury(at->second);
  points -= at->second.record.points;
  entries.erase(at);
}

Status WriterState::restore(std::uint64_t revision) {
  if (!changed.empty()) return invalid("there are changes that are not committed");
  if (last.record.revision == 0) return make_error(ErrorCode::kNotFound, "has no revision yet");
  MAPCODEC_ASSIGN(Commit newest, read_commit(*store, last.offset));
  MAPCODEC_ASSIGN(Commit commit, find_revision(*store, std::move(newest), revision));
  MAPCODEC_ASSIGN(ArchiveState then, load_state(*store, std::move(commit)));
  std::map<TileId, IndexEntry, TileIdLess> old = std::exchange(entries, {});
  for (IndexEntry& entry : then.entries) {
    const TileId id = id_of(entry.record);
    const auto now = old.find(id);
    if (now == old.end() || now->second.record.segments != entry.record.segments)
      changed.emplace(id, now != old.end());
    if (now != old.end()) old.erase(now);
    entries.emplace_hint(entries.end(), id, std::move(entry));
  }
  for (const auto& [id, entry] : old) changed.emplace(id, true);
  points = 0;
  for (const auto& [id, entry] : entries) points += entry.record.points;
  then.info.snapshots = std::move(info.snapshots);
  info = std::move(then.info);
  return {};
}

bool WriterState::stores_hashes(const IndexBlock& block) const {
  return hashes && !block.set.empty() &&
         std::all_of(block.set.begin(), block.set.end(),
                     [](const IndexEntry& e) { return e.record.hashes.size() == e.record.segments.size(); });
}

IndexBlock WriterState::full_block() const {
  IndexBlock block{false, false, entries.size(), {}, {}, dead};
  block.set.reserve(entries.size());
  for (const auto& [id, entry] : entries) block.set.push_back(entry);
  block.hashes = stores_hashes(block);
  return block;
}

IndexBlock WriterState::delta_block() const {
  IndexBlock block{true, false, entries.size(), {}, {}, dead};
  for (const auto& [id, was_there] : changed) {
    const auto at = entries.find(id);
    if (at != entries.end()) {
      block.set.push_back(at->second);
    } else if (was_there) {
      block.removed.push_back(id);
    }
  }
  block.hashes = stores_hashes(block);
  return block;
}

/// The changes, until all changes since the last full index outgrow half of it.
Bytes WriterState::encode_block(const IndexContext& context, bool& delta) const {
  delta = last.record.revision > 0 && last.deltas < kMaxDeltas;
  if (!delta) return encode_index(full_block(), context);
  Bytes bytes = encode_index(delta_block(), context);
  delta = last.delta_index_bytes + bytes.size() <= last.full_index_bytes / 2;
  return delta ? bytes : encode_index(full_block(), context);
}

Result<CommitRecord> WriterState::make_record(std::int64_t timestamp_s, std::size_t index_bytes,
                                              std::size_t head_bytes) const {
  if (head_bytes > kMaxBlockBytes)
    return make_error(ErrorCode::kLimitExceeded, "the index of the map is too large");
  return CommitRecord{
      false,
      timestamp_s,
      last.offset,
      static_cast<std::uint32_t>(next_revision > 0 ? next_revision : last.record.revision + 1),
      static_cast<std::uint32_t>(index_bytes),
      static_cast<std::uint32_t>(head_bytes - index_bytes)};
}

Result<std::uint64_t> WriterState::commit(std::int64_t timestamp_s) {
  if (timestamp_s < 0 || timestamp_s > kMaxTimestamp) return invalid("the timestamp is out of range");
  if (last.record.revision == std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::kLimitExceeded, "holds as many revisions as the format can number");
  }
  Bytes metadata = encode_metadata(info, points);
  MAPCODEC_ASSIGN(const MapInfo stored, decode_metadata(metadata));
  std::sort(dead.begin(), dead.end(),
            [](const SegmentRef& a, const SegmentRef& b) { return a.offset < b.offset; });
  bool delta = false;
  Bytes head = encode_block({info.origin, info.tile_size_m, stored.achieved, begin, 0}, delta);
  const std::size_t index_bytes = head.size();
  if (!delta || metadata != last.metadata) head.insert(head.end(), metadata.begin(), metadata.end());
  MAPCODEC_ASSIGN(const CommitRecord record, make_record(timestamp_s, index_bytes, head.size()));
  MAPCODEC_ASSIGN(const std::uint64_t end, store->end());
  const std::uint64_t offset = end + head.size();
  const auto tail = write_record(record, offset, head);
  head.insert(head.end(), tail.begin(), tail.end());
  MAPCODEC_TRY(store->publish(head));
  last.metadata = std::move(metadata);
  advance(record, offset, delta);
  return std::uint64_t{record.revision};
}

void WriterState::advance(const CommitRecord& record, std::uint64_t offset, bool delta) {
  last.record = record;
  last.offset = offset;
  last.full_index_bytes = delta ? last.full_index_bytes : record.index_bytes;
  last.delta_index_bytes = delta ? last.delta_index_bytes + record.index_bytes : 0;
  last.deltas = delta ? last.deltas + 1 : 0;
  begin = waypoint = offset + kRecordBytes;
  next_revision = 0;
  changed.clear();
  dead.clear();
}

}  // namespace mapcodec
