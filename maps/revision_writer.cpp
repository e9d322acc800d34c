// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/revision_writer.hpp"

#include <algorithm>

#include "mapcodec/base/crc32c.hpp"
#include "maps/map_archive.hpp"
#include "maps/metadata_codec.hpp"

namespace mapcodec {
namespace {

bool is_damage(const Error& error) {
  return error.code == ErrorCode::kChecksumMismatch || error.code == ErrorCode::kArchiveDamaged ||
         error.code == ErrorCode::kUnreadable;
}

/// Errors are left out: they are upper bounds in both, and may be rounded differently.
bool is_same(const IndexEntry& a, const IndexEntry& b) {
  return a.record.segments == b.record.segments && a.record.codec == b.record.codec &&
         a.record.points == b.record.points && a.bounds == b.bounds;
}

/// Both in order: what of `to` is new or another, and what of `from` is gone.
void compare(const std::vector<IndexEntry>& from, const std::vector<IndexEntry>& to, IndexBlock& block) {
  const TileIdLess less;
  auto a = from.begin();
  for (const IndexEntry& entry : to) {
    for (; a != from.end() && less(id_of(a->record), id_of(entry.record)); ++a)
      block.removed.push_back(id_of(a->record));
    const bool paired = a != from.end() && id_of(a->record) == id_of(entry.record);
    if (!paired || !is_same(*a, entry)) block.set.push_back(entry);
    if (paired) ++a;
  }
  for (; a != from.end(); ++a) block.removed.push_back(id_of(a->record));
}

}  // namespace

Result<Bytes> RevisionWriter::read(const TileRecord& tile, const SegmentRef& segment) const {
  auto bytes = source_.read(segment.offset, segment.length);
  if (!bytes.ok() && bytes.error().code == ErrorCode::kTruncated)
    return make_error(ErrorCode::kArchiveDamaged, "the file ends before tile " + tile_name(tile),
                      segment.offset);
  if (bytes.ok() && crc32c(*bytes) != segment.crc)
    return make_error(ErrorCode::kChecksumMismatch,
                      "tile " + tile_name(tile) + " does not match its checksum", segment.offset);
  return bytes;
}

Result<RevisionWriter::Copied> RevisionWriter::copy_segment(const TileRecord& tile,
                                                            const SegmentRef& segment) {
  const Place place{segment.offset, segment.length};
  if (const auto known = copied_.find(place); known != copied_.end()) return known->second;
  MAPCODEC_ASSIGN(const Bytes bytes, read(tile, segment));
  MAPCODEC_ASSIGN(const SegmentRef ref, out_.append(bytes));
  const Copied copied{ref, settings_.hashes ? hash_bytes(bytes) : ContentHash()};
  copied_.emplace(place, copied);
  return copied;
}

Result<IndexEntry> RevisionWriter::write_folded(const MapInfo& info, const TileRecord& tile,
                                                const FoldedTile& folded) {
  const auto code = encode_bounds(folded.bounds, tile.key, info.origin, info.tile_size_m);
  if (!code || !is_valid(folded.errors) || folded.bytes.empty() || folded.bytes.size() > kMaxSegmentBytes)
    return make_error(ErrorCode::kInvalidArgument, "tile " + tile_name(tile) + " cannot be stored as folded");
  MAPCODEC_ASSIGN(const SegmentRef ref, out_.append(folded.bytes));
  const ContentHash hash = settings_.hashes ? hash_bytes(folded.bytes) : ContentHash();
  // Not a place of the source: no segment there begins within the header.
  copied_.emplace(Place{0, static_cast<std::uint32_t>(folded_.size())}, Copied{ref, hash});
  IndexEntry entry{{tile.key, tile.submap, folded.codec, folded.points, {}, folded.errors, {ref}, {}}, *code};
  entry.record.bounds = decode_bounds(*code, tile.key, info.origin, info.tile_size_m);
  if (settings_.hashes) entry.record.hashes = {hash};
  return entry;
}

/// True if the tile is now one segment.
Result<bool> RevisionWriter::fold_tile(const MapInfo& info, IndexEntry& entry) {
  if (!settings_.fold || entry.record.segments.size() < 2) return false;
  std::vector<std::uint64_t> name;
  for (const SegmentRef& s : entry.record.segments) name.push_back(s.offset);
  if (const auto known = folded_.find(name); known != folded_.end()) {
    entry = known->second;
    return true;
  }
  std::vector<Bytes> segments;
  for (const SegmentRef& s : entry.record.segments) {
    MAPCODEC_ASSIGN(Bytes bytes, read(entry.record, s));
    segments.push_back(std::move(bytes));
  }
  MAPCODEC_ASSIGN(const auto folded, settings_.fold(info, entry.record, segments));
  if (!folded) return false;
  MAPCODEC_ASSIGN(entry, write_folded(info, entry.record, *folded));
  folded_.emplace(std::move(name), entry);
  return true;
}

Status RevisionWriter::copy_tile(const MapInfo& info, IndexEntry& entry) {
  MAPCODEC_ASSIGN(const bool folded, fold_tile(info, entry));
  if (folded) return {};
  std::vector<Copied> copies;
  if (settings_.skip_damaged) {  // a damaged delta must not leave its base behind
    for (const SegmentRef& s : entry.record.segments) {
      if (!copied_.contains({s.offset, s.length})) MAPCODEC_TRY(read(entry.record, s));
    }
  }
  for (const SegmentRef& s : entry.record.segments) {
    MAPCODEC_ASSIGN(const Copied copied, copy_segment(entry.record, s));
    copies.push_back(copied);
  }
  entry.record.segments.clear();
  entry.record.hashes.clear();
  for (const Copied& c : copies) {
    entry.record.segments.push_back(c.ref);
    if (settings_.hashes) entry.record.hashes.push_back(c.hash);
  }
  return {};
}

bool RevisionWriter::lose(const TileRecord& tile, const Error& error, std::uint64_t revision) {
  if (!settings_.skip_damaged || !is_damage(error)) return false;
  // The same version in several revisions is one loss.
  if (bad_.emplace(tile.segments.back().offset, true).second)
    lost_.push_back({tile.submap, tile.key, tile.points, revision, error.to_string(), 0});
  return true;
}

Result<std::vector<IndexEntry>> RevisionWriter::copy_tiles(ArchiveState& state) {
  std::vector<IndexEntry> entries;
  entries.reserve(state.entries.size());
  for (IndexEntry& entry : state.entries) {
    if (settings_.stop && settings_.stop()) return make_error(ErrorCode::kCancelled, "was stopped");
    const Status copied = copy_tile(state.info, entry);
    if (copied.ok()) {
      entries.push_back(std::move(entry));
    } else if (!lose(entry.record, copied.error(), state.record.revision)) {
      return copied.error();
    }
  }
  return entries;
}

/// By counts of tiles, not of bytes: what is decided must be decided alike when the result is rewritten.
IndexBlock RevisionWriter::make_block(const std::vector<IndexEntry>& entries) const {
  IndexBlock block{true, settings_.hashes, entries.size(), {}, {}, {}};
  if (record_ != 0 && deltas_ < kMaxDeltas) compare(previous_, entries, block);
  const std::uint64_t changes = changes_ + block.set.size() + block.removed.size();
  if (record_ == 0 || deltas_ >= kMaxDeltas || 4 * changes > entries.size())
    block = {false, settings_.hashes, entries.size(), entries, {}, {}};
  block.hashes = settings_.hashes && !block.set.empty();
  return block;
}

Status RevisionWriter::write_head(const ArchiveState& state, const IndexBlock& block, bool last) {
  Bytes metadata = encode_metadata(state.info, total_points(previous_));
  MAPCODEC_ASSIGN(const MapInfo stored, decode_metadata(metadata));
  Bytes head = encode_index(block, {state.info.origin, state.info.tile_size_m, stored.achieved, begin_, 0});
  CommitRecord record = state.record;
  record.previous = record_;
  record.index_bytes = static_cast<std::uint32_t>(head.size());
  if (!block.delta || metadata != metadata_) head.insert(head.end(), metadata.begin(), metadata.end());
  if (head.size() > kMaxBlockBytes)
    return make_error(ErrorCode::kLimitExceeded, "the index of the map is too large");
  record.metadata_bytes = static_cast<std::uint32_t>(head.size() - record.index_bytes);
  MAPCODEC_ASSIGN(const std::uint64_t end, out_.end());
  record_ = end + head.size();
  const auto tail = write_record(record, record_, head);
  head.insert(head.end(), tail.begin(), tail.end());
  metadata_ = std::move(metadata);
  begin_ = record_ + kRecordBytes;
  if (last) return out_.publish(head);
  MAPCODEC_TRY(out_.append(head));
  return {};
}

Status RevisionWriter::write(ArchiveState state, bool last) {
  if (record_ == 0) {
    MAPCODEC_TRY(out_.append(archive_header()));
    begin_ = kHeaderBytes;
  }
  MAPCODEC_ASSIGN(std::vector<IndexEntry> entries, copy_tiles(state));
  const IndexBlock block = make_block(entries);
  changes_ = block.delta ? changes_ + block.set.size() + block.removed.size() : 0;
  deltas_ = block.delta ? deltas_ + 1 : 0;
  previous_ = std::move(entries);
  return write_head(state, block, last);
}

}  // namespace mapcodec
