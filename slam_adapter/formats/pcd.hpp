// SPDX-License-Identifier: GPL-3.0-or-later
// PCD 0.5 to 0.7 of the Point Cloud Library: ascii, binary, binary_compressed.
#pragma once

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {

struct PcdHeader {
  enum class Data { ascii, binary, compressed };
  std::vector<RecordField> fields;
  std::size_t stride = 0;
  std::uint64_t points = 0;
  Data data = Data::ascii;
  std::string unkept;  ///< what the header says beyond points and channels, as a sentence; empty if nothing
};

/// Reads up to and with the DATA line. Errors: Malformed (with line), Empty (no point), Unsupported.
[[nodiscard]] Result<PcdHeader> read_pcd_header(Cursor& cursor);
[[nodiscard]] ReaderResult open_pcd(const ByteStream& stream);

}  // namespace mapcodec
