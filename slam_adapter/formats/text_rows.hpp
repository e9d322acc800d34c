// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "slam_adapter/formats/file_sink.hpp"
#include "slam_adapter/formats/record_plan.hpp"

namespace mapcodec {

/// Appends records as lines of numbers, each the shortest text that reads back the same.
[[nodiscard]] Status append_text_rows(OutputFile& file, const std::vector<RecordField>& fields,
                                      std::size_t stride, ByteSpan rows);

}  // namespace mapcodec
