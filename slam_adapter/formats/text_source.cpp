// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/text_table.hpp"

namespace mapcodec {
namespace {

/// Words in a line if all are numbers; 0 if not.
std::size_t count_numbers(std::string_view line) {
  Words words(line, true);
  std::string_view word;
  std::size_t n = 0;
  for (double v = 0; words.next(word); ++n) {
    if (!parse_number(word, v)) return 0;
  }
  return n;
}

void skip_byte_order_mark(Cursor& cursor) {
  const ByteSpan three = cursor.take(3);
  const bool mark = three.size() == 3 && three[0] == 0xEF && three[1] == 0xBB && three[2] == 0xBF;
  cursor.seek(mark ? 3 : 0);
}

/// The words of a header line, if they name x, y and z.
std::vector<std::string> column_names(std::string_view line) {
  std::string plain(line);
  for (char& c : plain) {
    if (c == '#' || c == '/' || c == '"' || c == '\'') c = ' ';
  }
  std::vector<std::string> names;
  std::string_view word;
  for (Words words(plain, true); words.next(word);) names.push_back(column_key(word));
  const auto has = [&](const std::string& n) {
    return std::any_of(names.begin(), names.end(),
                       [&](const std::string& v) { return v == n || v.starts_with(n + ":"); });
  };
  return has("x") && has("y") && has("z") ? names : std::vector<std::string>();
}

/// Goes to the first line of numbers, past comments and one line of words, and gives the columns' names if
/// told there.
Result<std::vector<std::string>> pass_header(Cursor& cursor) {
  std::vector<std::string> names;
  bool words_seen = false;
  std::string_view line;
  for (;;) {
    const std::uint64_t at = cursor.offset(), lines = cursor.line_number();
    if (!cursor.line(line)) break;
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string_view::npos) continue;
    if (count_numbers(line) > 0) {
      cursor.seek(at, lines);
      return names;
    }
    const bool comment = line[first] == '#' || line.substr(first).starts_with("//");
    if (!comment && words_seen) return line_error(cursor, quoted(line) + " is no line of numbers");
    words_seen = words_seen || !comment;
    if (names.empty()) names = column_names(line);
  }
  MAPCODEC_TRY(cursor.status());
  return make_error(ErrorCode::kEmpty, "holds no point (no line of numbers)");
}

bool moves_points(TextShape shape, const TextTransform& pose) {
  const TextTransform identity;
  return shape == TextShape::ptx || pose.rows != identity.rows || pose.translation != identity.translation;
}

class TextReader final : public RecordReader {
 public:
  TextReader(TextShape shape, const PointLines& lines, std::vector<RecordField> fields, RecordPlan plan,
             const TextTransform& pose)
      : shape_(shape),
        pose_(pose),
        fields_(std::move(fields)),
        plan_(std::move(plan)),
        start_(lines),
        lines_(lines) {
    moves_ = moves_points(shape, pose);
  }
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return std::nullopt; }
  [[nodiscard]] std::uint64_t skipped() const override { return skipped_; }
  void rewind() override {
    lines_ = start_;
    skipped_ = 0;
  }
  [[nodiscard]] std::vector<std::string> warnings() const override {
    if (lines_.warning().empty()) return {};
    return {lines_.warning()};
  }
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    std::string_view line;
    std::size_t n = 0;
    while (n < max) {
      auto more = lines_.next(line);
      if (!more.ok()) return more.error();
      if (!*more) break;
      std::uint8_t* row = rows + n * plan_.stride;
      MAPCODEC_TRY(parse_row(lines_.cursor(), line, fields_, row, true));
      if (!moves_ || place(row)) ++n;
    }
    return n;
  }

 private:
  /// Transforms the point of `row`; false if it is PTX's "no return".
  bool place(std::uint8_t* row) {
    Vec3 p;
    for (std::size_t d = 0; d < 3; ++d) std::memcpy(&p[d], row + plan_.axes[d].offset, sizeof(double));
    if (shape_ == TextShape::ptx && p == Vec3{0, 0, 0}) {
      ++skipped_;
      return false;
    }
    p = shape_ == TextShape::ptx ? lines_.transform()(p) : pose_(p);
    for (std::size_t d = 0; d < 3; ++d) std::memcpy(row + plan_.axes[d].offset, &p[d], sizeof(double));
    return true;
  }

  TextShape shape_;
  TextTransform pose_;
  bool moves_ = false;
  std::vector<RecordField> fields_;
  RecordPlan plan_;
  PointLines start_, lines_;
  std::uint64_t skipped_ = 0;
};

}  // namespace

ReaderResult open_text(const ByteStream& stream, TextShape shape, const TextTransform& pose) {
  Cursor cursor(stream);
  skip_byte_order_mark(cursor);
  MAPCODEC_ASSIGN(const std::vector<std::string> names, pass_header(cursor));
  const PointLines lines(shape, cursor);
  // A transform needs doubles whatever a header said.
  const bool moved = moves_points(shape, pose);
  MAPCODEC_ASSIGN(std::vector<RecordField> fields,
                  guess_columns(lines, moved ? std::vector<std::string>() : names));
  const std::size_t stride = fields.back().offset + scalar_size(fields.back().scalar);
  MAPCODEC_ASSIGN(RecordPlan plan, RecordPlan::from_fields(fields, stride, false));
  return std::unique_ptr<RecordReader>(
      std::make_unique<TextReader>(shape, lines, std::move(fields), std::move(plan), pose));
}

std::optional<TextShape> recognise_text(const ByteStream& stream) {
  Cursor cursor(stream);
  skip_byte_order_mark(cursor);
  std::string_view line;
  if (!cursor.content_line(line, true)) return std::nullopt;
  const std::size_t first = count_numbers(line);
  const bool printable =
      std::none_of(line.begin(), line.end(), [](char c) { return c >= 0 && c < ' ' && c != '\t'; });
  const std::size_t second = printable && cursor.content_line(line, true) ? count_numbers(line) : 0;
  if (first == 1) return second == 1 ? TextShape::ptx : TextShape::pts;
  if (first >= 3 || (first == 0 && second >= 3)) return TextShape::plain;
  return std::nullopt;
}

}  // namespace mapcodec
