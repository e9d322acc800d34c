// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "slam_adapter/formats/cursor.hpp"
#include "slam_adapter/formats/record_plan.hpp"
#include "slam_adapter/formats/text_number.hpp"

namespace mapcodec {

/// Malformed: "line N: what".
[[nodiscard]] Error line_error(const Cursor& cursor, const std::string& what);
/// Parses one number for each component of `fields` from the words of `line` into `row`. Errors: Malformed,
/// naming line and word. More words than numbers are an error too. `table`: commas and semicolons separate as
/// well.
[[nodiscard]] Status parse_row(const Cursor& cursor, std::string_view line,
                               const std::vector<RecordField>& fields, std::uint8_t* row, bool table = false);
/// Truncated if the file is too short for `count` lines of `numbers` numbers.
[[nodiscard]] Status check_text_size(const Cursor& cursor, std::uint64_t count, std::uint64_t numbers);
/// Truncated: "announces N points, but ends after M".
[[nodiscard]] Error too_few_lines(const Cursor& cursor, std::uint64_t announced, std::uint64_t found);
/// Malformed if a non-blank line follows the `announced` points.
[[nodiscard]] Status check_no_more_lines(Cursor& cursor, std::uint64_t announced);

}  // namespace mapcodec
