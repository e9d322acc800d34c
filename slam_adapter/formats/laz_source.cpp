// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/laz.hpp"

#include "mapcodec/base/byte_reader.hpp"
#include "slam_adapter/formats/las_header.hpp"
#include "slam_adapter/formats/las_layout.hpp"
#include "slam_adapter/formats/laz_points.hpp"

namespace mapcodec {
namespace {

constexpr std::uint32_t kVariableChunks = 0xffffffff;

/// What LASzip's record in the header says.
struct LazSetup {
  unsigned compressor = 0;  ///< 1 one chunk, 2 chunks, 3 layered chunks
  std::uint32_t chunk_points = 0;
  std::vector<LazItem> items;
};

struct ChunkRange {
  std::uint64_t begin = 0, end = 0, points = 0;
};

Error malformed(const std::string& what, std::optional<std::uint64_t> at = std::nullopt) {
  return make_error(ErrorCode::kMalformed, what, at);
}

Result<LazSetup> parse_setup(ByteSpan bytes) {
  ByteReader in(bytes);
  LazSetup s;
  s.compressor = in.u16();
  const unsigned coder = in.u16();
  in.raw(8);  // version, options
  s.chunk_points = in.u32();
  in.raw(16);  // special records
  const unsigned items = in.u16();
  for (unsigned i = 0; i < items && in.ok(); ++i) {
    const auto type = static_cast<LazItemType>(in.u16());
    const std::uint16_t size = in.u16(), version = in.u16();
    s.items.push_back({type, size, version});
  }
  MAPCODEC_TRY(in.status("the record of LASzip"));
  if (coder != 0 || s.compressor < 1 || s.compressor > 3)
    return make_error(ErrorCode::kUnsupported,
                      "is LAZ of an unknown compressor (" + std::to_string(s.compressor) + ")");
  return s;
}

/// Finds LASzip's record among those of variable length.
Result<LazSetup> read_setup(const ByteStream& stream, const LasHeader& h) {
  Cursor cursor(stream);
  cursor.seek(h.header_size);
  for (std::uint32_t i = 0; i < h.records && cursor.offset() + 54 <= h.data_offset; ++i) {
    const ByteSpan head = cursor.take(54);
    MAPCODEC_TRY(cursor.status());
    if (head.size() < 54) break;
    const std::string user(head.begin() + 2, head.begin() + 18);
    ByteReader in(head.subspan(18));
    const unsigned id = in.u16(), size = in.u16();
    if (!user.starts_with("laszip encoded") || id != 22204) {
      cursor.skip(size);
      continue;
    }
    const ByteSpan body = cursor.take(size);
    MAPCODEC_TRY(cursor.status());
    return parse_setup(body);
  }
  return malformed("is LAZ without the record that says how it is compressed");
}

/// The least size of an item and the versions of its coder that are read.
bool is_known(const LazItem& i) {
  switch (i.type) {
    case LazItemType::bytes:
      return i.size > 0 && i.version == 2;
    case LazItemType::point10:
      return i.size == 20 && i.version == 2;
    case LazItemType::gps_time:
      return i.size == 8 && i.version == 2;
    case LazItemType::rgb:
      return i.size == 6 && i.version == 2;
    case LazItemType::point14:
      return i.size == 30 && i.version >= 2 && i.version <= 4;
    case LazItemType::rgb14:
      return i.size == 6 && i.version >= 2 && i.version <= 4;
    case LazItemType::rgb_nir14:
      return i.size == 8 && i.version >= 2 && i.version <= 4;
    case LazItemType::bytes14:
      return i.size > 0 && i.version >= 2 && i.version <= 4;
  }
  return false;
}

/// Items are those of the point format, in its order.
Status check_items(const LazSetup& s, const LasHeader& h) {
  std::vector<LazItemType> wanted;
  if (h.format < 4) {
    wanted = {LazItemType::point10};
    if (h.format == 1 || h.format == 3) wanted.push_back(LazItemType::gps_time);
    if (h.format >= 2) wanted.push_back(LazItemType::rgb);
  } else if (h.format >= 6 && h.format <= 8) {
    wanted = {LazItemType::point14};
    if (h.format == 7) wanted.push_back(LazItemType::rgb14);
    if (h.format == 8) wanted.push_back(LazItemType::rgb_nir14);
  } else {
    return make_error(ErrorCode::kUnsupported, "is LAZ of point format " + std::to_string(h.format) +
                                                   " (wave packets): unpack it first with 'laszip -i IN.laz "
                                                   "-o OUT.las'");
  }
  std::size_t size = 0;
  for (std::size_t i = 0; i < s.items.size(); ++i) {
    const LazItem& item = s.items[i];
    const LazItemType extra = h.format < 6 ? LazItemType::bytes : LazItemType::bytes14;
    if (item.type != (i < wanted.size() ? wanted[i] : extra) || i > wanted.size())
      return malformed("is LAZ whose parts are not those of point format " + std::to_string(h.format));
    if (!is_known(item)) {
      return make_error(ErrorCode::kUnsupported, "is LAZ by a coder that is not read (item " +
                                                     std::to_string(static_cast<unsigned>(item.type)) +
                                                     " version " + std::to_string(item.version) +
                                                     "): unpack it first with 'laszip -i IN.laz -o OUT.las'");
    }
    size += item.size;
  }
  if (s.items.size() < wanted.size() || size != h.stride)
    return malformed("is LAZ whose parts do not make up its points of " + std::to_string(h.stride) +
                     " bytes");
  if ((s.compressor == 3) != (h.format >= 6))
    return malformed("is LAZ whose compressor does not fit point format " + std::to_string(h.format));
  return {};
}

/// Where the chunk table lies: the place stands before the first chunk, or, if that was unknown when the file
/// was begun, at its end.
Result<std::uint64_t> table_place(const ByteStream& stream, const LasHeader& h) {
  std::uint8_t bytes[8];
  for (const std::uint64_t at : {h.data_offset, std::max<std::uint64_t>(stream.size(), 8) - 8}) {
    MAPCODEC_ASSIGN(const std::size_t got, stream.read_at(at, bytes, 8));
    if (got < 8) return make_error(ErrorCode::kTruncated, "ends before its chunks", at);
    const std::uint64_t place = ByteReader(ByteSpan(bytes, 8)).u64();
    if (place + 1 <= 1) continue;
    if (place < h.data_offset + 8 || place + 8 > stream.size())
      return make_error(
          ErrorCode::kTruncated,
          "ends before its table of chunks (which is to be at byte " + std::to_string(place) + ")", at);
    return place;
  }
  return malformed("does not say where its table of chunks lies", h.data_offset);
}

Result<std::vector<ChunkRange>> read_table(const ByteStream& stream, const LasHeader& h, const LazSetup& s) {
  MAPCODEC_ASSIGN(const std::uint64_t place, table_place(stream, h));
  LazBytes bytes(stream, place, stream.size());
  const std::uint32_t version = bytes.u32(), count = bytes.u32();
  if (version != 0 || bytes.failed())
    return make_error(ErrorCode::kUnsupported, "has a table of chunks of version " + std::to_string(version),
                      place);
  LazDecoder decoder;
  decoder.begin(bytes);
  LazIntegers numbers(32, 2);
  std::vector<ChunkRange> chunks;
  std::uint64_t at = h.data_offset + 8, left = h.points;
  std::int32_t points = 0, size = 0;
  for (std::uint32_t i = 0; i < count && left > 0; ++i) {
    if (s.chunk_points == kVariableChunks) points = numbers.next(decoder, points, 0);
    size = numbers.next(decoder, size, 1);
    const std::uint64_t chunk = static_cast<std::uint32_t>(size);
    if (decoder.failed() || chunk > place - at)
      return malformed("has a table of chunks that does not fit the file", place);
    std::uint64_t held =
        s.chunk_points == kVariableChunks ? static_cast<std::uint32_t>(points) : s.chunk_points;
    held = std::min(held, left);
    if (held > 0) chunks.push_back({at, at + chunk, held});
    at += chunk;
    left -= held;
  }
  if (left > 0)
    return make_error(ErrorCode::kTruncated,
                      "announces " + std::to_string(h.points) + " points, but its chunks hold " +
                          std::to_string(h.points - left),
                      place);
  return chunks;
}

class LazReader final : public RecordReader {
 public:
  LazReader(const ByteStream& stream, const LasHeader& h, LazSetup setup, std::vector<ChunkRange> chunks)
      : stream_(stream),
        plan_(las_plan(h.format, h.stride, h.coordinates)),
        count_(h.points),
        setup_(std::move(setup)),
        chunks_(std::move(chunks)) {}
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return count_; }
  void rewind() override {
    at_ = 0;
    left_ = 0;
    chunk_.reset();
  }
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    std::size_t n = 0;
    while (n < max) {
      if (left_ == 0) {
        if (at_ == chunks_.size()) break;
        MAPCODEC_TRY(open_chunk(chunks_[at_++]));
      }
      if (!chunk_->next(rows + n * plan_.stride))
        return make_error(ErrorCode::kTruncated, "has a chunk that ends before its last point",
                          chunks_[at_ - 1].begin);
      --left_;
      ++n;
    }
    return n;
  }

 private:
  Status open_chunk(const ChunkRange& range) {
    const bool layered = setup_.compressor == 3;
    MAPCODEC_ASSIGN(chunk_, (layered ? open_layered_chunk : open_pointwise_chunk)(setup_.items, stream_,
                                                                                  range.begin, range.end));
    if (layered && chunk_->points() != range.points) {
      return make_error(ErrorCode::kMalformed,
                        "has a chunk of " + std::to_string(chunk_->points()) + " points instead of " +
                            std::to_string(range.points),
                        range.begin);
    }
    left_ = range.points;
    return {};
  }

  const ByteStream& stream_;
  RecordPlan plan_;
  std::uint64_t count_;
  LazSetup setup_;
  std::vector<ChunkRange> chunks_;
  std::size_t at_ = 0;
  std::uint64_t left_ = 0;
  std::unique_ptr<LazChunk> chunk_;
};

}  // namespace

ReaderResult open_laz(const ByteStream& stream) {
  MAPCODEC_ASSIGN(const LasHeader h, read_las_header(stream));
  if (!h.compressed) return malformed("is no LAZ");
  MAPCODEC_ASSIGN(LazSetup setup, read_setup(stream, h));
  MAPCODEC_TRY(check_items(setup, h));
  std::vector<ChunkRange> chunks{{h.data_offset, stream.size(), h.points}};
  if (setup.compressor != 1) {
    MAPCODEC_ASSIGN(chunks, read_table(stream, h, setup));
  }
  return std::unique_ptr<RecordReader>(
      std::make_unique<LazReader>(stream, h, std::move(setup), std::move(chunks)));
}

}  // namespace mapcodec
