// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/text_table.hpp"

namespace mapcodec {

Vec3 TextTransform::operator()(const Vec3& p) const {
  Vec3 r;
  for (std::size_t d = 0; d < 3; ++d)
    r[d] = rows[d][0] * p[0] + rows[d][1] * p[1] + rows[d][2] * p[2] + translation[d];
  return r;
}

Result<bool> PointLines::plain_line(std::string_view& line) {
  if (cursor_.content_line(line, true)) return true;
  MAPCODEC_TRY(cursor_.status());
  return false;
}

Result<bool> PointLines::next(std::string_view& line) {
  if (shape_ == TextShape::plain) return plain_line(line);
  while (found_ == announced_) {
    auto begun = begin_block();
    if (!begun.ok() || !*begun) return begun;
  }
  MAPCODEC_ASSIGN(const bool more, plain_line(line));
  if (!more) return too_few_lines(cursor_, announced_, found_);
  ++found_;
  return true;
}

/// False at the end of the file.
Result<bool> PointLines::begin_block() {
  if (ended_) return false;
  MAPCODEC_ASSIGN(bool begun, read_count(announced_));
  found_ = 0;
  ended_ = !begun;
  if (!begun) {
    announced_ = 0;
    return false;
  }
  if (shape_ == TextShape::ptx) {
    std::uint64_t rows = 0;
    MAPCODEC_ASSIGN(begun, read_count(rows));
    if (!begun)
      return make_error(ErrorCode::kTruncated, "the PTX header ends after its columns", cursor_.offset());
    if (rows != 0 && announced_ > cursor_.left() / rows) {
      return make_error(ErrorCode::kTruncated,
                        "announces " + std::to_string(announced_) + " x " + std::to_string(rows) +
                            " points, more than its size can hold",
                        cursor_.offset());
    }
    announced_ *= rows;
    MAPCODEC_TRY(read_ptx_header());
  }
  MAPCODEC_TRY(check_text_size(cursor_, announced_, 3));
  any_block_ = true;
  return true;
}

/// A line with one whole number. After a PTS block anything else ends the points: such files are common.
Result<bool> PointLines::read_count(std::uint64_t& count) {
  std::string_view line, word, more;
  MAPCODEC_ASSIGN(const bool there, plain_line(line));
  if (!there) return false;
  Words words(line, true);
  words.next(word);
  const bool alone = !words.next(more);
  if (alone && parse_number(word, count)) return true;
  if (shape_ == TextShape::pts && any_block_ && !alone) {
    warning_ = "line " + std::to_string(cursor_.line_number()) + " and what follows lie beyond the " +
               std::to_string(announced_) + " points that the file announces; they are left out";
    return false;
  }
  return line_error(cursor_, quoted(line) + " is no number of points");
}

Status PointLines::read_numbers(std::size_t count, double* to) {
  std::string_view line, word;
  MAPCODEC_ASSIGN(const bool there, plain_line(line));
  if (!there) return make_error(ErrorCode::kTruncated, "ends within a PTX header", cursor_.offset());
  Words words(line, true);
  for (std::size_t i = 0; i < count; ++i) {
    if (!words.next(word) || !parse_number(word, to[i]) || !std::isfinite(to[i])) {
      return line_error(cursor_,
                        quoted(line) + " is no row of " + std::to_string(count) + " numbers of a PTX header");
    }
  }
  return {};
}

/// The scanner's position and axes (4 x 3, which repeat the matrix), then the matrix, 4 x 4, for row vectors.
Status PointLines::read_ptx_header() {
  double row[4];
  for (int i = 0; i < 4; ++i) MAPCODEC_TRY(read_numbers(3, row));
  for (std::size_t i = 0; i < 4; ++i) {
    MAPCODEC_TRY(read_numbers(4, row));
    for (std::size_t d = 0; d < 3; ++d) (i < 3 ? transform_.rows[d][i] : transform_.translation[d]) = row[d];
  }
  return {};
}

}  // namespace mapcodec
