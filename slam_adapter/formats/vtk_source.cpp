// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/byte_order.hpp"
#include "slam_adapter/formats/vtk.hpp"

namespace mapcodec {
namespace {

/// One array, read forwards, each on its own cursor since VTK stores column after column.
class ArrayCursor {
 public:
  ArrayCursor(const ByteStream& stream, const VtkArray& array) : array_(array), cursor_(stream) { rewind(); }
  void rewind() {
    cursor_.seek(array_.offset, array_.lines);
    line_.clear();
    words_ = Words("");
  }
  Status read(bool ascii, std::uint8_t* rows, std::size_t stride, std::size_t count) {
    return ascii ? read_text(rows, stride, count) : read_binary(rows, stride, count);
  }

 private:
  Status read_binary(std::uint8_t* rows, std::size_t stride, std::size_t count) {
    const RecordField& f = array_.field;
    const std::size_t size = scalar_size(f.scalar) * f.components;
    const ByteSpan bytes = cursor_.take(count * size);
    if (bytes.size() < count * size)
      return make_error(ErrorCode::kTruncated, "became shorter while it was read", cursor_.offset());
    for (std::size_t i = 0; i < count; ++i) {
      std::uint8_t* to = rows + i * stride + f.offset;
      std::memcpy(to, bytes.data() + i * size, size);
      swap_scalars(to, scalar_size(f.scalar), f.components);
    }
    return {};
  }
  Status read_text(std::uint8_t* rows, std::size_t stride, std::size_t count) {
    const RecordField& f = array_.field;
    const std::size_t size = scalar_size(f.scalar);
    std::string_view word;
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < f.components; ++k) {
        MAPCODEC_TRY(next_word(word));
        if (store_number(word, f.scalar, rows + i * stride + f.offset + k * size)) continue;
        return line_error(cursor_,
                          quoted(word) + " is no " + scalar_name(f.scalar) + " number for " + quoted(f.name));
      }
    }
    return {};
  }
  Status next_word(std::string_view& word) {
    std::string_view line;
    while (!words_.next(word)) {
      if (!cursor_.line(line))
        return make_error(ErrorCode::kTruncated, "ends within " + quoted(array_.field.name),
                          cursor_.offset());
      line_ = line;
      words_ = Words(line_);
    }
    return {};
  }

  VtkArray array_;
  Cursor cursor_;
  std::string line_;  ///< a copy: a line may hold several points, more than one block wants
  Words words_{""};
};

class VtkReader final : public RecordReader {
 public:
  VtkReader(const ByteStream& stream, VtkFile file, RecordPlan plan)
      : file_(std::move(file)), plan_(std::move(plan)) {
    for (const VtkArray& a : file_.arrays) arrays_.emplace_back(stream, a);
  }
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return file_.points; }
  [[nodiscard]] std::vector<std::string> warnings() const override { return file_.warnings; }
  void rewind() override {
    for (ArrayCursor& a : arrays_) a.rewind();
    done_ = 0;
  }
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(max, file_.points - done_));
    for (ArrayCursor& a : arrays_) MAPCODEC_TRY(a.read(file_.ascii, rows, plan_.stride, n));
    done_ += n;
    return n;
  }

 private:
  VtkFile file_;
  RecordPlan plan_;
  std::vector<ArrayCursor> arrays_;
  std::uint64_t done_ = 0;
};

/// The arrays as record fields; the points as x, y, z.
std::vector<RecordField> fields_of(const VtkFile& file) {
  std::vector<RecordField> fields;
  for (const VtkArray& a : file.arrays) {
    const RecordField& f = a.field;
    if (&a != &file.arrays.front()) {
      fields.push_back(f);
      continue;
    }
    const std::size_t size = scalar_size(f.scalar);
    for (std::size_t d = 0; d < 3; ++d) fields.push_back({std::string(1, "xyz"[d]), f.scalar, 1, d * size});
  }
  return fields;
}

}  // namespace

ReaderResult open_vtk(const ByteStream& stream) {
  Cursor cursor(stream);
  MAPCODEC_ASSIGN(VtkFile file, scan_vtk(cursor));
  MAPCODEC_ASSIGN(RecordPlan plan, RecordPlan::from_fields(fields_of(file), file.stride, false));
  return std::unique_ptr<RecordReader>(std::make_unique<VtkReader>(stream, std::move(file), std::move(plan)));
}

}  // namespace mapcodec
