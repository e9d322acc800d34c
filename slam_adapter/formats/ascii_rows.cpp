// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/ascii_rows.hpp"

#include <algorithm>

namespace mapcodec {

Error line_error(const Cursor& cursor, const std::string& what) {
  return make_error(ErrorCode::kMalformed, "line " + std::to_string(cursor.line_number()) + ": " + what);
}

Status parse_row(const Cursor& cursor, std::string_view line, const std::vector<RecordField>& fields,
                 std::uint8_t* row, bool table) {
  Words words(line, table);
  std::string_view word;
  for (const RecordField& f : fields) {
    const std::size_t size = scalar_size(f.scalar);
    for (std::size_t k = 0; k < f.components; ++k) {
      if (!words.next(word))
        return line_error(cursor, "has too few numbers (none for " + quoted(f.name) + ")");
      // PCL writes "_" padding as nothing readable in particular: its words are counted, not parsed.
      if (f.name != "_" && !store_number(word, f.scalar, row + f.offset + k * size)) {
        return line_error(cursor,
                          quoted(word) + " is no " + scalar_name(f.scalar) + " number for " + quoted(f.name));
      }
    }
  }
  if (words.next(word))
    return line_error(cursor, "has more numbers than the header has fields, from " + quoted(word) + " on");
  return {};
}

Status check_text_size(const Cursor& cursor, std::uint64_t count, std::uint64_t numbers) {
  // One digit and one separator each; the last line may lack its end.
  const std::uint64_t possible = (cursor.left() + 1) / (2 * std::max<std::uint64_t>(numbers, 1));
  if (count <= possible) return {};
  return make_error(ErrorCode::kTruncated,
                    "announces " + std::to_string(count) + " points, but the " +
                        std::to_string(cursor.left()) + " bytes after the header hold at most " +
                        std::to_string(possible),
                    cursor.offset());
}

Error too_few_lines(const Cursor& cursor, std::uint64_t announced, std::uint64_t found) {
  return make_error(ErrorCode::kTruncated, "announces " + std::to_string(announced) +
                                               " points, but ends after " + std::to_string(found) +
                                               " (line " + std::to_string(cursor.line_number()) + ")");
}

Status check_no_more_lines(Cursor& cursor, std::uint64_t announced) {
  std::string_view line;
  if (!cursor.content_line(line, true)) return cursor.status();
  return line_error(
      cursor, "more data follows the " + std::to_string(announced) + " points that the header announces");
}

}  // namespace mapcodec
