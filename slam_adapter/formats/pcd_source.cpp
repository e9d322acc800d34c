// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "mapcodec/base/byte_reader.hpp"
#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/lzf.hpp"
#include "slam_adapter/formats/pcd.hpp"

namespace mapcodec {
namespace {

class PcdReader : public RecordReader {
 public:
  PcdReader(const Cursor& body, PcdHeader header, RecordPlan plan)
      : header_(std::move(header)), plan_(std::move(plan)), body_(body), cursor_(body) {}
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return header_.points; }
  void rewind() override {
    cursor_ = body_;
    done_ = 0;
  }
  [[nodiscard]] std::vector<std::string> warnings() const override {
    return header_.unkept.empty() ? std::vector<std::string>{} : std::vector{header_.unkept};
  }

 protected:
  PcdHeader header_;
  RecordPlan plan_;
  Cursor body_, cursor_;  ///< body_ stays at the first byte after the header
  std::uint64_t done_ = 0;
};

class BinaryPcd final : public PcdReader {
 public:
  using PcdReader::PcdReader;
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    MAPCODEC_ASSIGN(const std::size_t n,
                    read_records(cursor_, header_.points - done_, header_.stride, rows, max));
    done_ += n;
    return n;
  }
};

class AsciiPcd final : public PcdReader {
 public:
  using PcdReader::PcdReader;
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    std::size_t n = 0;
    std::string_view line;
    for (; n < max && done_ < header_.points; ++n, ++done_) {
      if (!cursor_.content_line(line, true)) {
        MAPCODEC_TRY(cursor_.status());
        return too_few_lines(cursor_, header_.points, done_);
      }
      MAPCODEC_TRY(parse_row(cursor_, line, header_.fields, rows + n * header_.stride));
    }
    if (n == 0) MAPCODEC_TRY(check_no_more_lines(cursor_, header_.points));
    return n;
  }
};

/// Field after field instead of point after point, so the whole body is unpacked at once.
class CompressedPcd final : public PcdReader {
 public:
  using PcdReader::PcdReader;
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    if (columns_.empty()) MAPCODEC_TRY(unpack());
    const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(max, header_.points - done_));
    for (const RecordField& f : header_.fields) {
      const std::size_t size = scalar_size(f.scalar) * f.components;
      const std::uint8_t* from = columns_.data() + f.offset * header_.points + done_ * size;
      for (std::size_t i = 0; i < n; ++i)
        std::memcpy(rows + i * header_.stride + f.offset, from + i * size, size);
    }
    done_ += n;
    return n;
  }

 private:
  Status unpack() {
    const ByteSpan packed = cursor_.take(8 + static_cast<std::size_t>(cursor_.left()));
    MAPCODEC_TRY(cursor_.status());
    ByteReader in(packed);
    const std::uint32_t packed_size = in.u32(), unpacked_size = in.u32();
    const ByteSpan body = in.raw(packed_size);
    if (!in.ok()) return make_error(ErrorCode::kTruncated, "became shorter while it was read");
    columns_.resize(unpacked_size);
    if (lzf_decode(body, columns_)) return {};
    columns_ = {};
    return make_error(ErrorCode::kMalformed, "the compressed data are damaged", body_.offset());
  }
  Bytes columns_;
};

/// PCL leaves some zeros (a memory page and a bit) behind compressed data.
bool only_padding(Cursor cursor, std::uint64_t packed) {
  constexpr std::uint64_t kMaxPadding = 65536 + 4096;
  cursor.skip(packed);
  if (cursor.left() > kMaxPadding) return false;
  const ByteSpan rest = cursor.take(static_cast<std::size_t>(cursor.left()));
  return std::all_of(rest.begin(), rest.end(), [](std::uint8_t b) { return b == 0; });
}

/// The two sizes before compressed data, against each other, the header and the file.
Status check_compressed(Cursor cursor, const PcdHeader& h) {
  const std::uint64_t at = cursor.offset();
  ByteReader in(cursor.take(8));
  const std::uint64_t packed = in.u32(), unpacked = in.u32(), left = cursor.left();
  MAPCODEC_TRY(cursor.status());
  if (!in.ok())
    return make_error(ErrorCode::kTruncated,
                      "announces " + std::to_string(h.points) + " points, but ends after the header", at);
  const auto text = [](std::uint64_t v) { return std::to_string(v); };
  if (h.points > unpacked / h.stride || h.points * h.stride != unpacked) {
    return make_error(ErrorCode::kMalformed,
                      "announces " + text(h.points) + " points of " + text(h.stride) +
                          " bytes, but its compressed data unpack to " + text(unpacked) + " bytes (" +
                          text(unpacked / h.stride) + " points)",
                      at);
  }
  const std::string sizes =
      "announces " + text(packed) + " bytes of compressed data, but holds " + text(left);
  if (packed > left) return make_error(ErrorCode::kTruncated, sizes, at);
  if (packed < left && !only_padding(cursor, packed)) return make_error(ErrorCode::kMalformed, sizes, at);
  if (unpacked > packed * kLzfMaxRatio) {
    return make_error(ErrorCode::kMalformed,
                      "cannot hold " + text(unpacked) + " bytes in " + text(packed) + " compressed ones", at);
  }
  return {};
}

std::uint64_t numbers_per_point(const PcdHeader& h) {
  std::uint64_t n = 0;
  for (const RecordField& f : h.fields) n += f.components;
  return n;
}

}  // namespace

ReaderResult open_pcd(const ByteStream& stream) {
  Cursor cursor(stream);
  MAPCODEC_ASSIGN(PcdHeader h, read_pcd_header(cursor));
  MAPCODEC_ASSIGN(RecordPlan plan, RecordPlan::from_fields(h.fields, h.stride, true));
  using Reader = std::unique_ptr<RecordReader>;
  if (h.data == PcdHeader::Data::binary) {
    MAPCODEC_TRY(check_exact_size(cursor, h.points, h.stride));
    return Reader(std::make_unique<BinaryPcd>(cursor, std::move(h), std::move(plan)));
  }
  if (h.data == PcdHeader::Data::compressed) {
    MAPCODEC_TRY(check_compressed(cursor, h));
    return Reader(std::make_unique<CompressedPcd>(cursor, std::move(h), std::move(plan)));
  }
  MAPCODEC_TRY(check_text_size(cursor, h.points, numbers_per_point(h)));
  return Reader(std::make_unique<AsciiPcd>(cursor, std::move(h), std::move(plan)));
}

}  // namespace mapcodec
