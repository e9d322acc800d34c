// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/bag_file.hpp"

#include "slam_adapter/formats/cursor.hpp"
#include "slam_adapter/rosbag/bag_chunk.hpp"
#include "slam_adapter/rosbag/bag_record.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kMagicBytes = 13;
constexpr std::uint32_t kMostHeaderBytes = 1u << 20;
constexpr std::uint32_t kMostConnectionBytes = 1u << 24;

Error truncated(std::uint64_t at) {
  return make_error(ErrorCode::kTruncated,
                    "ends within a record of the bag; 'rosbag reindex' may save what is whole", at);
}
Error malformed(const std::string& what, std::uint64_t at) {
  return make_error(ErrorCode::kMalformed, what, at);
}

/// Walks the records outside chunks.
class Walk {
 public:
  Walk(const ByteStream& stream, BagFile& bag) : cursor_(stream), bag_(bag) {}

  Status run() {
    cursor_.seek(kMagicBytes);
    while (cursor_.left() > 0) MAPCODEC_TRY(record());
    MAPCODEC_TRY(cursor_.status());
    if (loose_messages_ > 0)
      bag_.warnings.push_back(std::to_string(loose_messages_) +
                              " messages lie outside chunks and are left out");
    return {};
  }

 private:
  Result<Bytes> sized(std::uint32_t most, const char* what) {
    const std::uint64_t at = cursor_.offset();
    const ByteSpan head = cursor_.take(4);
    MAPCODEC_TRY(cursor_.status());
    if (head.size() < 4) return truncated(at);
    const std::uint32_t size = ByteReader(head).u32();
    if (size > cursor_.left()) return truncated(at);
    if (size > most)
      return malformed(std::string("holds ") + what + " of " + std::to_string(size) + " bytes", at);
    const ByteSpan bytes = cursor_.take(size);
    MAPCODEC_TRY(cursor_.status());
    if (bytes.size() < size) return truncated(at);
    return Bytes(bytes.begin(), bytes.end());
  }

  Status record() {
    const std::uint64_t at = cursor_.offset();
    MAPCODEC_ASSIGN(const Bytes header, sized(kMostHeaderBytes, "a record's header"));
    const auto fields = BagFields::parse(header);
    if (!fields || !fields->op()) return malformed("holds a record without fields of a bag", at);
    if (*fields->op() == BagOp::connection) return connection(*fields, at);
    const std::uint64_t size_at = cursor_.offset();
    const ByteSpan head = cursor_.take(4);
    MAPCODEC_TRY(cursor_.status());
    if (head.size() < 4) return truncated(size_at);
    const std::uint32_t size = ByteReader(head).u32();
    if (size > cursor_.left()) return truncated(size_at);
    MAPCODEC_TRY(look(*fields, at, size));
    cursor_.skip(size);
    return {};
  }

  Status look(const BagFields& fields, std::uint64_t at, std::uint32_t size) {
    switch (*fields.op()) {
      case BagOp::bag_header:
        if (!fields.text("encryptor").empty())
          return make_error(ErrorCode::kUnsupported, "is encrypted: decrypt it first with 'rosbag decrypt'");
        return {};
      case BagOp::chunk:
        return chunk(fields, at, size);
      case BagOp::index:
        if (const auto number = fields.u32("conn"); number && !bag_.chunks.empty())
          bag_.chunks.back().connections.insert(*number);
        return {};
      case BagOp::message:
        ++loose_messages_;
        return {};
      default:
        return {};
    }
  }

  Status chunk(const BagFields& fields, std::uint64_t at, std::uint32_t packed) {
    const auto size = fields.u32("size");
    if (!size) return malformed("holds a chunk that does not say its size", at);
    bag_.chunks.push_back({cursor_.offset(), packed, *size, fields.text("compression"), {}});
    return {};
  }

  Status connection(const BagFields& fields, std::uint64_t at) {
    MAPCODEC_ASSIGN(const Bytes data, sized(kMostConnectionBytes, "a connection"));
    const auto number = fields.u32("conn");
    const auto about = BagFields::parse(data);
    if (!number || !about) return malformed("holds a connection without number or type", at);
    bag_.connections[*number] = {fields.text("topic"), about->text("type")};
    return {};
  }

  Cursor cursor_;
  BagFile& bag_;
  std::uint64_t loose_messages_ = 0;
};

/// One record within an unpacked chunk; advances `at`.
struct InnerRecord {
  BagFields fields;
  ByteSpan data;
};
std::optional<InnerRecord> inner_record(const Bytes& chunk, std::size_t& at) {
  ByteReader in(ByteSpan(chunk).subspan(at));
  const ByteSpan header = in.raw(in.u32());
  const ByteSpan data = in.raw(in.u32());
  if (!in.ok()) return std::nullopt;
  auto fields = BagFields::parse(header);
  if (!fields || !fields->op()) return std::nullopt;
  at += in.offset();
  return InnerRecord{*fields, data};
}

Result<Bytes> read_chunk(const ByteStream& stream, const BagChunk& chunk) {
  Bytes packed(chunk.packed);  // at most what the file holds: the walk has compared
  MAPCODEC_ASSIGN(const std::size_t got, stream.read_at(chunk.offset, packed.data(), packed.size()));
  if (got < packed.size()) return truncated(chunk.offset);
  auto bytes = unpack_bag_chunk(chunk.compression, std::move(packed), chunk.size);
  if (!bytes.ok()) return make_error(bytes.error().code, bytes.error().message, chunk.offset);
  return bytes;
}

/// For bags whose recorder was stopped before it wrote the index: connections stand in the chunks as well.
Status find_connections(const ByteStream& stream, BagFile& bag) {
  for (const BagChunk& chunk : bag.chunks) {
    MAPCODEC_ASSIGN(const Bytes bytes, read_chunk(stream, chunk));
    for (std::size_t at = 0; at < bytes.size();) {
      const auto record = inner_record(bytes, at);
      if (!record) return malformed("holds a chunk with a broken record", chunk.offset);
      if (*record->fields.op() != BagOp::connection) continue;
      const auto number = record->fields.u32("conn");
      const auto about = BagFields::parse(record->data);
      if (!number || !about) return malformed("holds a connection without number or type", chunk.offset);
      bag.connections[*number] = {record->fields.text("topic"), about->text("type")};
    }
  }
  return {};
}

bool meets(const std::set<std::uint32_t>& a, const std::set<std::uint32_t>& b) {
  for (const std::uint32_t v : a) {
    if (b.count(v) > 0) return true;
  }
  return false;
}

}  // namespace

Result<BagFile> BagFile::open(const ByteStream& stream) {
  Cursor cursor(stream);
  const ByteSpan head = cursor.take(kMagicBytes);
  MAPCODEC_TRY(cursor.status());
  const std::string magic(head.begin(), head.end());
  if (magic != "#ROSBAG V2.0\n")
    return make_error(
        ErrorCode::kUnsupported,
        "is no ROS bag of format 2.0: bring it there first with 'rosbag fix' or 'rosbag reindex'");
  BagFile bag;
  MAPCODEC_TRY(Walk(stream, bag).run());
  if (bag.chunks.empty()) return make_error(ErrorCode::kEmpty, "holds no message (no chunk)");
  if (bag.connections.empty()) {
    bag.warnings.emplace_back("the bag has no index (its recorder was stopped): all of it is looked through");
    MAPCODEC_TRY(find_connections(stream, bag));
  }
  return bag;
}

std::set<std::uint32_t> BagFile::of_type(const std::string& type) const {
  std::set<std::uint32_t> r;
  for (const auto& [number, connection] : connections) {
    if (connection.type == type) r.insert(number);
  }
  return r;
}

void BagMessages::rewind() {
  chunk_ = 0;
  bytes_.clear();
  at_ = 0;
}

Result<bool> BagMessages::load_chunk() {
  for (; chunk_ < bag_.chunks.size(); ++chunk_) {
    const BagChunk& chunk = bag_.chunks[chunk_];
    if (!chunk.connections.empty() && !meets(chunk.connections, wanted_)) continue;
    MAPCODEC_ASSIGN(bytes_, read_chunk(stream_, chunk));
    at_ = 0;
    ++chunk_;
    return true;
  }
  return false;
}

Result<bool> BagMessages::next(BagMessage& message) {
  for (;;) {
    if (at_ == bytes_.size()) {
      MAPCODEC_ASSIGN(const bool more, load_chunk());
      if (!more) return false;
      continue;
    }
    const auto record = inner_record(bytes_, at_);
    const std::uint64_t offset = bag_.chunks[chunk_ - 1].offset;
    if (!record) return malformed("holds a chunk with a broken record", offset);
    if (*record->fields.op() != BagOp::message) continue;
    const auto number = record->fields.u32("conn");
    const auto time = record->fields.time_ns("time");
    if (!number || !time) return malformed("holds a message without connection or time", offset);
    if (wanted_.count(*number) == 0) continue;
    message = {*number, *time, record->data};
    return true;
  }
}

}  // namespace mapcodec
