// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/las.hpp"

#include "slam_adapter/formats/las_header.hpp"
#include "slam_adapter/formats/las_layout.hpp"

namespace mapcodec {
namespace {

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
  MAPCODEC_ASSIGN(const LasHeader h, read_las_header(stream));
  if (h.compressed) return make_error(ErrorCode::kUnsupported, "is LAZ (compressed LAS)");
  Cursor cursor(stream);
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
