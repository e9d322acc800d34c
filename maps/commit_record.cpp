// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/commit_record.hpp"

#include <algorithm>
#include <cstring>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/base/crc32c.hpp"

namespace mapcodec {
namespace {

constexpr std::uint8_t kMajor = 0, kMinor = 1;
constexpr std::array<std::uint8_t, 6> kMagic = {0x89, 'M', 'P', 'C', '\r', '\n'};
constexpr std::array<std::uint8_t, 4> kRecordMagic = {0xC3, 'm', 'p', 0x1E};
constexpr std::uint8_t kWaypointFlag = 1;
constexpr std::uint64_t kChunk = std::uint64_t{1} << 20;

Error damaged(const std::string& what, std::uint64_t offset) {
  return make_error(ErrorCode::kArchiveDamaged, what, offset);
}

/// Covers the header and the record's own place too: a record copied elsewhere is none.
std::uint32_t record_crc(ByteSpan header, std::uint64_t offset, ByteSpan blocks, ByteSpan fields) {
  ByteWriter place;
  place.u64(offset);
  return crc32c(fields, crc32c(blocks, crc32c(place.bytes(), crc32c(header))));
}

void put(ByteWriter& out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out.u8(static_cast<std::uint8_t>(value >> (8 * i)));
}
std::uint64_t get(ByteReader& in, int bytes) {
  std::uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value |= std::uint64_t{in.u8()} << (8 * i);
  return value;
}

bool starts_like_archive(const Bytes& b) {
  return b.size() >= 4 && (b[0] & 0x7F) == (kMagic[0] & 0x7F) &&
         std::equal(b.begin() + 1, b.begin() + 4, kMagic.begin() + 1);
}

/// The fields of a record; nothing if these bytes cannot be one at `offset`.
std::optional<CommitRecord> parse_fields(ByteSpan bytes, std::uint64_t offset) {
  if (!std::equal(kRecordMagic.begin(), kRecordMagic.end(), bytes.begin())) return std::nullopt;
  ByteReader in(bytes.subspan(kRecordMagic.size()));
  CommitRecord r;
  const std::uint8_t flags = in.u8();
  r.waypoint = (flags & kWaypointFlag) != 0;
  r.timestamp_s = static_cast<std::int64_t>(get(in, 5));
  r.previous = get(in, 6);
  r.revision = in.u32();
  r.index_bytes = in.u32();
  r.metadata_bytes = in.u32();
  const std::uint64_t begin = r.previous == 0 ? kHeaderBytes : r.previous + kRecordBytes;
  const bool fits = begin <= offset && r.block_bytes() <= offset - begin && r.block_bytes() <= kMaxBlockBytes;
  const bool linked = r.previous == 0 ? !r.waypoint : r.previous >= kHeaderBytes;
  const bool shaped =
      (r.waypoint ? r.block_bytes() == 0 : r.index_bytes > 0) && r.revision > 0 && flags <= kWaypointFlag;
  return fits && linked && shaped ? std::optional(r) : std::nullopt;
}

Result<Commit> check_commit(const TileStore& store, ByteSpan bytes, std::uint64_t offset) {
  const auto record = parse_fields(bytes, offset);
  if (!record) return damaged("no commit record", offset);
  Commit commit{*record, offset, {}};
  MAPCODEC_ASSIGN(const Bytes header, store.read(0, kHeaderBytes));
  MAPCODEC_ASSIGN(commit.blocks, store.read(offset - record->block_bytes(), record->block_bytes()));
  ByteReader crc(bytes.last(4));
  if (crc.u32() != record_crc(header, offset, commit.blocks, bytes.first(kRecordBytes - 4))) {
    return damaged("commit record and its index do not match their checksum", offset);
  }
  return commit;
}

/// Looks for records backwards, chunk by chunk. What a false record claims is read before it is refused, so
/// hostile bytes could make that dear: the sum is bounded.
class BackwardSearch {
 public:
  /// @param thorough  to the beginning of the file, also past waypoints that lead nowhere.
  BackwardSearch(const TileStore& store, std::uint64_t end, bool thorough = false)
      : store_(store), end_(end), budget_(2 * end + (kChunk << 6)), thorough_(thorough) {}

  Result<Commit> run() {
    const std::uint64_t most = thorough_ ? end_ : std::min(end_, kMaxSearchBytes);
    const std::uint64_t stop = std::max<std::uint64_t>(kHeaderBytes, end_ - most);
    for (std::uint64_t high = end_; high >= stop + kRecordBytes;) {
      const std::uint64_t low = high - stop > kChunk ? high - kChunk : stop;
      MAPCODEC_ASSIGN(const Bytes chunk, store_.read(low, high - low));
      auto found = search(chunk, low);
      if (found) return *std::move(found);
      if (low == stop) break;
      high = low + kRecordBytes - 1;  // overlap: a record may lie across the border
    }
    return damaged("holds no whole commit", end_);
  }

 private:
  std::optional<Result<Commit>> search(const Bytes& chunk, std::uint64_t low) {
    for (std::size_t at = chunk.size() < kRecordBytes ? 0 : chunk.size() - kRecordBytes + 1; at-- > 0;) {
      if (chunk[at] != kRecordMagic[0]) continue;
      auto found = examine(ByteSpan(chunk).subspan(at, kRecordBytes), low + at);
      if (found) return found;
    }
    return std::nullopt;
  }

  std::optional<Result<Commit>> examine(ByteSpan bytes, std::uint64_t offset) {
    const auto record = parse_fields(bytes, offset);
    if (!record) return std::nullopt;
    const std::uint64_t cost = record->block_bytes() + kRecordBytes;
    if (cost > budget_) return damaged("holds too many false commit records", offset);
    budget_ -= cost;
    auto commit = check_commit(store_, bytes, offset);
    if (!commit.ok()) return std::nullopt;
    if (!record->waypoint) return commit;
    auto led_to = follow(*record);
    if (thorough_ && !led_to.ok()) return std::nullopt;
    return led_to;
  }

  Result<Commit> follow(const CommitRecord& waypoint) const {
    auto commit = read_commit(store_, waypoint.previous);
    if (commit.ok() && commit->record.waypoint)
      return damaged("a waypoint points to a waypoint", waypoint.previous);
    return commit;
  }

  const TileStore& store_;
  std::uint64_t end_;
  std::uint64_t budget_;
  bool thorough_;
};

}  // namespace

std::array<std::uint8_t, kHeaderBytes> archive_header() {
  return {kMagic[0], kMagic[1], kMagic[2], kMagic[3], kMagic[4], kMagic[5], kMajor, kMinor};
}

Status check_header(const TileStore& store) {
  MAPCODEC_ASSIGN(const std::uint64_t end, store.end());
  if (end == 0) return make_error(ErrorCode::kEmpty, "is empty");
  MAPCODEC_ASSIGN(const Bytes header, store.read(0, std::min<std::uint64_t>(end, kHeaderBytes)));
  if (header.size() < kHeaderBytes) {
    const bool cut = std::equal(header.begin(), header.end(), archive_header().begin());
    if (cut) return damaged("ends within its header", end);
    return make_error(ErrorCode::kMalformed, "is not a mapcodec archive");
  }
  if (!std::equal(kMagic.begin(), kMagic.end(), header.begin())) {
    if (starts_like_archive(header)) return damaged("was damaged by a text-mode transfer", 0);
    return make_error(ErrorCode::kMalformed, "is not a mapcodec archive");
  }
  if (header[6] <= kMajor) return {};
  return make_error(ErrorCode::kUnsupported, "has format version " + std::to_string(header[6]) + "." +
                                                 std::to_string(header[7]) + ", this program reads " +
                                                 kArchiveFormatVersion);
}

std::array<std::uint8_t, kRecordBytes> write_record(const CommitRecord& record, std::uint64_t offset,
                                                    ByteSpan blocks) {
  ByteWriter out;
  out.raw(kRecordMagic);
  out.u8(record.waypoint ? kWaypointFlag : 0);
  put(out, static_cast<std::uint64_t>(record.timestamp_s), 5);
  put(out, record.previous, 6);
  out.u32(record.revision);
  out.u32(record.index_bytes);
  out.u32(record.metadata_bytes);
  out.u32(record_crc(archive_header(), offset, blocks, out.bytes()));
  std::array<std::uint8_t, kRecordBytes> bytes;
  std::copy(out.bytes().begin(), out.bytes().end(), bytes.begin());
  return bytes;
}

std::uint32_t commit_crc(std::uint64_t offset, ByteSpan blocks, ByteSpan fields) {
  return record_crc(archive_header(), offset, blocks, fields);
}

Result<Commit> read_commit(const TileStore& store, std::uint64_t offset) {
  auto bytes = store.read(offset, kRecordBytes);
  if (!bytes.ok() && bytes.error().code == ErrorCode::kTruncated) return damaged("no commit record", offset);
  if (!bytes.ok()) return bytes.error();
  return check_commit(store, *bytes, offset);
}

Result<Commit> find_last_commit(const TileStore& store) {
  MAPCODEC_TRY(check_header(store));
  MAPCODEC_ASSIGN(const std::uint64_t end, store.end());
  // Usually the file ends with its record.
  if (end >= kHeaderBytes + kRecordBytes) {
    auto commit = read_commit(store, end - kRecordBytes);
    if (commit.ok() && !commit->record.waypoint) return commit;
  }
  return BackwardSearch(store, end).run();
}

Result<Commit> find_commit_before(const TileStore& store, std::uint64_t end) {
  return BackwardSearch(store, end, true).run();
}

bool ends_like_commit(const TileStore& store) {
  const auto end = store.end();
  if (!end.ok() || *end < kHeaderBytes + kRecordBytes) return false;
  const auto bytes = store.read(*end - kRecordBytes, kRecordBytes);
  if (!bytes.ok()) return false;
  int alike = 0;
  for (std::size_t i = 0; i < kRecordMagic.size(); ++i) alike += (*bytes)[i] == kRecordMagic[i] ? 1 : 0;
  // One byte may be what was damaged. A waypoint at the end is what a killed writer leaves; its flag alone
  // does not make one.
  return alike >= 3 && !check_commit(store, *bytes, *end - kRecordBytes).ok();
}

}  // namespace mapcodec
