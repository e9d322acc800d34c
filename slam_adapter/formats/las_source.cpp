// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/las.hpp"

#include <cmath>

#include "mapcodec/base/byte_reader.hpp"
#include "slam_adapter/formats/las_layout.hpp"

namespace mapcodec {
namespace {

struct LasHeader {
  unsigned minor = 0, format = 0;
  std::uint64_t header_size = 0, data_offset = 0, points = 0;
  std::size_t stride = 0;
  CoordinateFormat coordinates{CoordinateFormat::Kind::fixed, {}, {}};
  bool may_have_tail = false;  ///< waveforms or extended records may follow the points
};

Error malformed(const std::string& what, std::uint64_t at) {
  return make_error(ErrorCode::kMalformed, what, at);
}

void read_tail_fields(ByteReader in, LasHeader& h) {
  if (h.minor < 3 || h.header_size < las_header_size(3)) return;
  in.raw(227);
  h.may_have_tail = in.u64() != 0;  // start of waveform data
  if (h.minor < 4 || h.header_size < las_header_size(4)) return;
  const std::uint64_t extended_at = in.u64();
  const std::uint32_t extended = in.u32();
  const std::uint64_t points = in.u64();
  h.may_have_tail = h.may_have_tail || (extended_at != 0 && extended > 0);
  if (points != 0) h.points = points;
}

LasHeader read_fields(ByteSpan bytes) {
  LasHeader h;
  ByteReader in(bytes);
  in.raw(25);
  h.minor = in.u8();
  in.raw(68);
  h.header_size = in.u16();
  h.data_offset = in.u32();
  in.u32();  // variable length records
  h.format = in.u8();
  h.stride = in.u16();
  h.points = in.u32();
  in.raw(20);
  for (double& v : h.coordinates.scale) v = in.f64();
  for (double& v : h.coordinates.offset) v = in.f64();
  read_tail_fields(ByteReader(bytes), h);
  return h;
}

Status check_numbers(const LasHeader& h) {
  for (std::size_t d = 0; d < 3; ++d) {
    const double s = h.coordinates.scale[d], o = h.coordinates.offset[d];
    if (!(s > 0) || !std::isfinite(s))
      return malformed("the LAS header has a scale that is not positive", 131 + 8 * d);
    if (!std::isfinite(o)) return malformed("the LAS header has an offset that is not finite", 155 + 8 * d);
  }
  return {};
}

Status check_header(const LasHeader& h, std::uint64_t file_size) {
  const auto text = [](std::uint64_t v) { return std::to_string(v); };
  if (h.format & 0xC0)
    return make_error(ErrorCode::kUnsupported,
                      "is LAZ (compressed LAS), which is not supported yet: unpack it first, for example "
                      "with 'laszip -i IN.laz -o OUT.las' or 'pdal translate IN.laz OUT.las'");
  if (h.format >= kLasFormats)
    return malformed("LAS point format " + text(h.format) + " does not exist", 104);
  if (h.header_size < las_header_size(h.minor))
    return malformed("LAS 1." + text(h.minor) + " with a header of only " + text(h.header_size) + " bytes",
                     94);
  if (h.data_offset < h.header_size || h.data_offset > file_size) {
    return malformed("points begin at byte " + text(h.data_offset) + " of " + text(file_size) +
                         ", after a header of " + text(h.header_size),
                     96);
  }
  if (h.stride < las_record_size(h.format)) {
    return malformed(
        "point records of " + text(h.stride) + " bytes are too short for format " + text(h.format), 105);
  }
  if (h.points == 0) return make_error(ErrorCode::kEmpty, "holds no point (the LAS header announces 0)");
  return check_numbers(h);
}

class LasReader final : public RecordReader {
 public:
  LasReader(const LasHeader& h, const Cursor& body)
      : plan_(las_plan(h.format, h.stride, h.coordinates)), count_(h.points), body_(body), cursor_(body) {}
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return count_; }
  void rewind() override {
    cursor_ = body_;
    done_ = 0;
  }
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    MAPCODEC_ASSIGN(const std::size_t n, read_records(cursor_, count_ - done_, plan_.stride, rows, max));
    done_ += n;
    return n;
  }

 private:
  RecordPlan plan_;
  std::uint64_t count_;
  Cursor body_, cursor_;
  std::uint64_t done_ = 0;
};

class KittiReader final : public RecordReader {
 public:
  explicit KittiReader(const ByteStream& stream) : cursor_(stream), count_(stream.size() / 16) {
    plan_.stride = 16;
    for (std::size_t d = 0; d < 3; ++d) plan_.axes[d] = {ScalarType::f32, 4 * d};
    plan_.add_channel({"intensity", ScalarType::f32, 1}, 12);
  }
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return count_; }
  void rewind() override { cursor_.seek(0); }
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    return read_records(cursor_, count_ - cursor_.offset() / 16, 16, rows, max);
  }

 private:
  RecordPlan plan_;
  Cursor cursor_;
  std::uint64_t count_;
};

}  // namespace

bool is_laz(const ByteStream& stream) {
  Cursor cursor(stream);
  const ByteSpan head = cursor.take(105);
  return head.size() == 105 && (head[104] & 0xC0) != 0;
}

ReaderResult open_las(const ByteStream& stream) {
  Cursor cursor(stream);
  const ByteSpan head = cursor.take(las_header_size(4));
  MAPCODEC_TRY(cursor.status());
  if (head.size() < las_header_size(2)) {
    return make_error(ErrorCode::kTruncated,
                      "ends within the LAS header (" + std::to_string(head.size()) + " of 227 bytes)",
                      head.size());
  }
  if (head[24] != 1 || head[25] > 4) {
    return make_error(
        ErrorCode::kUnsupported,
        "is LAS " + std::to_string(head[24]) + "." + std::to_string(head[25]) + "; 1.0 to 1.4 are read", 24);
  }
  const LasHeader h = read_fields(head);
  MAPCODEC_TRY(check_header(h, stream.size()));
  cursor.seek(h.data_offset);
  MAPCODEC_TRY(h.may_have_tail ? check_enough(cursor, h.points, h.stride)
                               : check_exact_size(cursor, h.points, h.stride));
  return std::unique_ptr<RecordReader>(std::make_unique<LasReader>(h, cursor));
}

ReaderResult open_kitti(const ByteStream& stream) {
  if (stream.size() % 16 != 0) {
    return make_error(ErrorCode::kMalformed, "is no KITTI scan: " + std::to_string(stream.size()) +
                                                 " bytes are no whole number of points of 16 bytes");
  }
  return std::unique_ptr<RecordReader>(std::make_unique<KittiReader>(stream));
}

}  // namespace mapcodec
