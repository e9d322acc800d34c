// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/map_writer.hpp"

#include <algorithm>
#include <limits>

#include "mapcodec/base/crc32c.hpp"
#include "maps/file_store.hpp"
#include "maps/metadata_codec.hpp"
#include "maps/writer_state.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kLongestName = 255;

Error invalid(const std::string& what) {
  return make_error(ErrorCode::kInvalidArgument, what);
}

/// A name that a person can tell from a revision's number and a terminal can show.
Status check_name(const std::string& name) {
  if (name.empty() || name.size() > kLongestName) return invalid("a name needs 1 to 255 bytes");
  if (std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7F; }))
    return invalid("a name must not hold control characters");
  if (std::all_of(name.begin(), name.end(), [](unsigned char c) { return c >= '0' && c <= '9'; }))
    return invalid("a name of digits only would be taken for a revision");
  return {};
}

}  // namespace

struct MapWriter::State : WriterState {};

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
  state_->put(id, std::move(entry));
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
  entry.record.hashes = at->second.record.hashes;
  MAPCODEC_TRY(state_->write_segment(entry, bytes));
  if (entry.record.hashes.size() != entry.record.segments.size()) entry.record.hashes.clear();
  state_->put(id, std::move(entry));
  return {};
}

Status MapWriter::remove(const TileKey& key, std::uint32_t submap) {
  const auto at = state_->entries.find({submap, key});
  if (at == state_->entries.end()) return make_error(ErrorCode::kNotFound, "there is no such tile to remove");
  state_->erase(at);
  return {};
}

const MapInfo& MapWriter::info() const {
  return state_->info;
}
std::size_t MapWriter::tile_count() const {
  return state_->entries.size();
}
std::uint64_t MapWriter::revision() const {
  return state_->last.record.revision;
}
Status MapWriter::number_next(std::uint64_t number) {
  if (number <= revision() || number > std::numeric_limits<std::uint32_t>::max())
    return invalid("revisions have ascending numbers of 32 bits");
  state_->next_revision = number;
  return {};
}

void MapWriter::store_hashes(bool store) {
  state_->hashes = store;
}

std::vector<const TileRecord*> MapWriter::tiles() const {
  std::vector<const TileRecord*> all;
  all.reserve(state_->entries.size());
  for (const auto& [id, entry] : state_->entries) all.push_back(&entry.record);
  return all;
}

std::vector<const TileRecord*> MapWriter::tiles_in(const Box& box) const {
  std::vector<const TileRecord*> found;
  PosedQuery query(state_->info, box);
  for (const auto& [id, entry] : state_->entries) {
    if (query.meets(entry.record)) found.push_back(&entry.record);
  }
  return found;
}

const TileRecord* MapWriter::find(const TileKey& key, std::uint32_t submap) const {
  const auto at = state_->entries.find({submap, key});
  return at == state_->entries.end() ? nullptr : &at->second.record;
}

Result<Bytes> MapWriter::read(const SegmentRef& segment) const {
  auto bytes = state_->store->read(segment.offset, segment.length);
  if (!bytes.ok() && bytes.error().code == ErrorCode::kTruncated)
    return make_error(ErrorCode::kArchiveDamaged, "the file ends before a segment", segment.offset);
  if (bytes.ok() && crc32c(*bytes) != segment.crc) {
    return make_error(ErrorCode::kChecksumMismatch, "a segment does not match its checksum", segment.offset);
  }
  return bytes;
}

Box MapWriter::posed_bounds() const {
  Box all, submap_box;
  std::uint32_t submap = 0;
  for (const auto& [id, entry] : state_->entries) {
    if (id.submap != submap) all.add(pose_of(state_->info, submap).apply(std::exchange(submap_box, {})));
    submap = id.submap;
    submap_box.add(entry.record.bounds);
  }
  all.add(pose_of(state_->info, submap).apply(submap_box));
  return all;
}

Status MapWriter::set_info(MapInfo info) {
  MAPCODEC_TRY(check_info(info));
  if (info.origin != state_->info.origin || info.tile_size_m != state_->info.tile_size_m) {
    return invalid("the origin and the tile size of a map never change");
  }
  state_->info = std::move(info);
  return {};
}

Status MapWriter::set_poses(std::span<const PoseChange> changes) {
  MapInfo info = state_->info;
  for (const PoseChange& change : changes) {
    MAPCODEC_TRY(check_pose(change.translation_m, change.rotation_xyzw));
    if (change.submap >= info.submaps.size())
      return invalid("there is no submap " + std::to_string(change.submap));
    info.submaps[change.submap].translation_m = change.translation_m;
    info.submaps[change.submap].rotation_xyzw = change.rotation_xyzw;
  }
  MapInfo before = std::exchange(state_->info, std::move(info));
  state_->info.bounds = posed_bounds();
  const Status fit = check_info(state_->info);
  if (!fit.ok()) state_->info = std::move(before);
  return fit;
}

Status MapWriter::add_snapshot(const std::string& name) {
  MAPCODEC_TRY(check_name(name));
  if (revision() == 0) return invalid("there is no revision yet that could be named");
  auto& snapshots = state_->info.snapshots;
  if (std::any_of(snapshots.begin(), snapshots.end(), [&](const Snapshot& s) { return s.name == name; }))
    return invalid("there is a snapshot '" + name + "' already");
  snapshots.push_back({name, revision()});
  return {};
}

Status MapWriter::remove_snapshot(const std::string& name) {
  if (std::erase_if(state_->info.snapshots, [&](const Snapshot& s) { return s.name == name; }) > 0) return {};
  return make_error(ErrorCode::kNotFound, "has no snapshot '" + name + "'");
}

Status MapWriter::restore(std::uint64_t revision) {
  return state_->restore(revision);
}

Result<std::uint64_t> MapWriter::commit(std::int64_t timestamp_s) {
  return state_->commit(timestamp_s);
}

}  // namespace mapcodec
