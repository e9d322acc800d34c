// SPDX-License-Identifier: GPL-3.0-or-later
// Columns of numbers: XYZ and its relatives, PTS (count, then lines; several blocks), PTX (scans with
// transforms), 3DTK.
#pragma once

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {

/// p' = rotation * p + translation, in the file's unit.
struct TextTransform {
  std::array<Vec3, 3> rows{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  Vec3 translation{0, 0, 0};
  [[nodiscard]] Vec3 operator()(const Vec3& p) const;
};

enum class TextShape { plain, pts, ptx };

/// The lines that hold points, without what stands between them.
class PointLines {
 public:
  /// `cursor` stands before the first point line (plain) or count (PTS, PTX).
  PointLines(TextShape shape, const Cursor& cursor) : shape_(shape), cursor_(cursor) {}
  /// The next point line; false at the end. Errors: Truncated, Malformed (a count or PTX header that is
  /// none).
  Result<bool> next(std::string_view& line);
  [[nodiscard]] const Cursor& cursor() const { return cursor_; }
  [[nodiscard]] const TextTransform& transform() const { return transform_; }  ///< PTX: of the line's scan
  /// A sentence if lines after the announced ones were left out.
  [[nodiscard]] const std::string& warning() const { return warning_; }

 private:
  Result<bool> plain_line(std::string_view& line);
  Result<bool> begin_block();
  Result<bool> read_count(std::uint64_t& count);
  Status read_numbers(std::size_t count, double* to);
  Status read_ptx_header();

  TextShape shape_;
  Cursor cursor_;
  std::uint64_t announced_ = 0, found_ = 0;  ///< of the block
  bool any_block_ = false, ended_ = false;
  TextTransform transform_;
  std::string warning_;
};

/// What the columns are called and made of. `names` may carry types ("x:f32"); without names their number and
/// the first lines' numbers decide: 4 = intensity, 6 = rgb or normal, 7 = intensity and rgb; a column is f32
/// if all its numbers in these lines have float's digits, else f64. Errors: Empty, Truncated, Malformed.
[[nodiscard]] Result<std::vector<RecordField>> guess_columns(PointLines lines,
                                                             const std::vector<std::string>& names);

/// `pose` moves the points of plain text (3DTK scans that lie in a folder).
[[nodiscard]] ReaderResult open_text(const ByteStream& stream, TextShape shape,
                                     const TextTransform& pose = {});

/// A header's word for a column, in lower case where it is one that has a meaning: "X" is x, "Ring" stays.
[[nodiscard]] std::string column_key(std::string_view word);

/// The shape that the first lines have; none if they are no numbers.
[[nodiscard]] std::optional<TextShape> recognise_text(const ByteStream& stream);

}  // namespace mapcodec
