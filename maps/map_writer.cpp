// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/map_writer.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "mapcodec/base/crc32c.hpp"
#include "maps/archive_state.hpp"
#include "maps/file_store.hpp"
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

struct MapWriter::State {
  std::unique_ptr<TileStore> store;
  MapInfo info;
  std::map<TileId, IndexEntry, TileIdLess> entries;
  std::map<TileId, bool, TileIdLess>
      changed;                         // since the last commit; true: the tile was there at that commit
  std::vector<SegmentRef> dead;        // ranges of this commit that are no tile's
  ArchiveState last;                   // without its entries; revision 0: there is none
  std::uint64_t begin = kHeaderBytes;  // of this commit's segments
  std::uint64_t waypoint = 0;          // end of the last record or waypoint

  void resume(ArchiveState state);
  [[nodiscard]] Result<IndexEntry> make_entry(const TileId& id, std::uint64_t points, const Box& bounds,
                                              const TileErrors& errors) const;
  [[nodiscard]] Status write_segment(IndexEntry& entry, ByteSpan bytes);
  [[nodiscard]] Status write_waypoint();
  void touch(const TileId& id) { changed.try_emplace(id, entries.count(id) > 0); }
  void bury(const IndexEntry& entry);
  [[nodiscard]] std::uint64_t points() const;
  [[nodiscard]] IndexBlock full_block() const;
  [[nodiscard]] IndexBlock delta_block() const;
  [[nodiscard]] IndexBlock choose_block(const IndexContext& context) const;
  [[nodiscard]] Result<std::uint64_t> commit(std::int64_t timestamp_s);
  void advance(const CommitRecord& record, std::uint64_t offset, bool delta);
};

void MapWriter::State::resume(ArchiveState state) {
  for (IndexEntry& entry : state.entries) {
    const TileId id = id_of(entry.record);
    entries.emplace_hint(entries.end(), id, std::move(entry));
  }
  state.entries.clear();
  info = state.info;
  begin = waypoint = state.offset + kRecordBytes;
  last = std::move(state);
}

Result<IndexEntry> MapWriter::State::make_entry(const TileId& id, std::uint64_t points, const Box& bounds,
                                                const TileErrors& errors) const {
  if (!is_placed_well(id.key)) return invalid("the tile's level is out of range");
  if (!is_valid(errors)) return invalid("an error of the tile is negative or not finite");
  const auto code = encode_bounds(bounds, id.key, info.origin, info.tile_size_m);
  if (!code) return invalid("the tile's bounds are not finite or far outside its cube");
  IndexEntry entry{{id.key, id.submap, 0, points, {}, errors, {}}, *code};
  entry.record.bounds = decode_bounds(*code, id.key, info.origin, info.tile_size_m);
  return entry;
}

Status MapWriter::State::write_segment(IndexEntry& entry, ByteSpan bytes) {
  if (bytes.empty() || bytes.size() > kMaxSegmentBytes) return invalid("a tile needs 1 byte to 1 GiB");
  MAPCODEC_ASSIGN(const SegmentRef segment, store->append(bytes));
  entry.record.segments.push_back(segment);
  const std::uint64_t end = segment.offset + segment.length;
  return last.record.revision > 0 && end - waypoint >= kWaypointEvery ? write_waypoint() : Status();
}

Status MapWriter::State::write_waypoint() {
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
void MapWriter::State::bury(const IndexEntry& entry) {
  std::copy_if(entry.record.segments.begin(), entry.record.segments.end(), std::back_inserter(dead),
               [this](const SegmentRef& s) { return s.offset >= begin; });
}

std::uint64_t MapWriter::State::points() const {
  std::uint64_t sum = 0;
  for (const auto& [id, entry] : entries) sum += entry.record.points;
  return sum;
}

IndexBlock MapWriter::State::full_block() const {
  IndexBlock block{false, entries.size(), {}, {}, dead};
  block.set.reserve(entries.size());
  for (const auto& [id, entry] : entries) block.set.push_back(entry);
  return block;
}

IndexBlock MapWriter::State::delta_block() const {
  IndexBlock block{true, entries.size(), {}, {}, dead};
  for (const auto& [id, was_there] : changed) {
    const auto at = entries.find(id);
    if (at != entries.end()) {
      block.set.push_back(at->second);
    } else if (was_there) {
      block.removed.push_back(id);
    }
  }
  return block;
}

/// The changes, until all changes since the last full index outgrow half of it.
IndexBlock MapWriter::State::choose_block(const IndexContext& context) const {
  if (last.record.revision == 0 || last.deltas >= kMaxDeltas) return full_block();
  IndexBlock block = delta_block();
  const std::uint64_t bytes = last.delta_index_bytes + encode_index(block, context).size();
  return bytes > last.full_index_bytes / 2 ? full_block() : block;
}

Result<std::uint64_t> MapWriter::State::commit(std::int64_t timestamp_s) {
  if (timestamp_s < 0 || timestamp_s > kMaxTimestamp) return invalid("the timestamp is out of range");
  if (last.record.revision == std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::kLimitExceeded, "holds as many revisions as the format can number");
  }
  Bytes metadata = encode_metadata(info, points());
  MAPCODEC_ASSIGN(const MapInfo stored, decode_metadata(metadata));
  std::sort(dead.begin(), dead.end(),
            [](const SegmentRef& a, const SegmentRef& b) { return a.offset < b.offset; });
  const IndexContext context{info.origin, info.tile_size_m, stored.achieved, begin, 0};
  const IndexBlock block = choose_block(context);
  Bytes head = encode_index(block, context);
  const std::size_t index_bytes = head.size();
  if (!block.delta || metadata != last.metadata) head.insert(head.end(), metadata.begin(), metadata.end());
  if (head.size() > kMaxBlockBytes)
    return make_error(ErrorCode::kLimitExceeded, "the index of the map is too large");
  MAPCODEC_ASSIGN(const std::uint64_t end, store->end());
  const CommitRecord record{false,
                            timestamp_s,
                            last.offset,
                            last.record.revision + 1,
                            static_cast<std::uint32_t>(index_bytes),
                            static_cast<std::uint32_t>(head.size() - index_bytes)};
  const std::uint64_t offset = end + head.size();
  const auto tail = write_record(record, offset, head);
  head.insert(head.end(), tail.begin(), tail.end());
  MAPCODEC_TRY(store->publish(head));
  last.metadata = std::move(metadata);
  advance(record, offset, block.delta);
  return std::uint64_t{record.revision};
}

void MapWriter::State::advance(const CommitRecord& record, std::uint64_t offset, bool delta) {
  last.record = record;
  last.offset = offset;
  last.full_index_bytes = delta ? last.full_index_bytes : record.index_bytes;
  last.delta_index_bytes = delta ? last.delta_index_bytes + record.index_bytes : 0;
  last.deltas = delta ? last.deltas + 1 : 0;
  begin = waypoint = offset + kRecordBytes;
  changed.clear();
  dead.clear();
}

MapWriter::MapWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
MapWriter::MapWriter(MapWriter&&) noexcept = default;
MapWriter& MapWriter::operator=(MapWriter&&) noexcept = default;
MapWriter::~MapWriter() = default;

Result<MapWriter> MapWriter::create(const std::string& path, MapInfo info, bool overwrite) {
  MAPCODEC_TRY(check_info(info));
  MAPCODEC_ASSIGN(std::unique_ptr<TileStore> store, FileStore::create(path, overwrite));
  return create(std::move(store), std::move(info));
}

Result<MapWriter> MapWriter::create(std::unique_ptr<TileStore> store, MapInfo info) {
  MAPCODEC_TRY(check_info(info));
  MAPCODEC_TRY(store->append(archive_header()));
  auto state = std::make_unique<State>();
  state->store = std::move(store);
  state->info = std::move(info);
  return MapWriter(std::move(state));
}

Result<MapWriter> MapWriter::open(const std::string& path) {
  MAPCODEC_ASSIGN(std::unique_ptr<TileStore> store, FileStore::open_for_writing(path));
  return open(std::move(store));
}

Result<MapWriter> MapWriter::open(std::unique_ptr<TileStore> store) {
  MAPCODEC_ASSIGN(Commit commit, find_last_commit(*store));
  MAPCODEC_ASSIGN(const std::uint64_t end, store->end());
  const std::uint64_t whole = commit.end();
  if (end > whole && ends_like_commit(*store)) {
    return make_error(ErrorCode::kArchiveDamaged, "ends with a damaged commit, which writing would lose",
                      whole);
  }
  MAPCODEC_ASSIGN(ArchiveState last, load_state(*store, std::move(commit)));
  if (end > whole) MAPCODEC_TRY(store->discard_after(whole));
  auto state = std::make_unique<State>();
  state->store = std::move(store);
  state->resume(std::move(last));
  return MapWriter(std::move(state));
}

Status MapWriter::add(const TileKey& key, std::uint8_t codec, std::uint64_t points, const Box& bounds,
                      const TileErrors& errors, ByteSpan bytes, std::uint32_t submap) {
  const TileId id{submap, key};
  MAPCODEC_ASSIGN(IndexEntry entry, state_->make_entry(id, points, bounds, errors));
  entry.record.codec = codec;
  MAPCODEC_TRY(state_->write_segment(entry, bytes));
  state_->touch(id);
  const auto [at, fresh] = state_->entries.try_emplace(id);
  if (!fresh) state_->bury(at->second);
  at->second = std::move(entry);
  return {};
}

Status MapWriter::extend(const TileKey& key, std::uint64_t points, const Box& bounds,
                         const TileErrors& errors, ByteSpan bytes, std::uint32_t submap) {
  const TileId id{submap, key};
  const auto at = state_->entries.find(id);
  if (at == state_->entries.end()) return make_error(ErrorCode::kNotFound, "there is no such tile to extend");
  MAPCODEC_ASSIGN(IndexEntry entry, state_->make_entry(id, points, bounds, errors));
  entry.record.codec = at->second.record.codec;
  entry.record.segments = at->second.record.segments;
  MAPCODEC_TRY(state_->write_segment(entry, bytes));
  state_->touch(id);
  at->second = std::move(entry);
  return {};
}

Status MapWriter::remove(const TileKey& key, std::uint32_t submap) {
  const TileId id{submap, key};
  const auto at = state_->entries.find(id);
  if (at == state_->entries.end()) return make_error(ErrorCode::kNotFound, "there is no such tile to remove");
  state_->touch(id);
  state_->bury(at->second);
  state_->entries.erase(at);
  return {};
}

const MapInfo& MapWriter::info() const {
  return state_->info;
}
std::size_t MapWriter::tile_count() const {
  return state_->entries.size();
}

Status MapWriter::set_info(MapInfo info) {
  MAPCODEC_TRY(check_info(info));
  if (info.origin != state_->info.origin || info.tile_size_m != state_->info.tile_size_m) {
    return invalid("the origin and the tile size of a map never change");
  }
  state_->info = std::move(info);
  return {};
}

Result<std::uint64_t> MapWriter::commit(std::int64_t timestamp_s) {
  return state_->commit(timestamp_s);
}

}  // namespace mapcodec
