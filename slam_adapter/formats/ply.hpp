// SPDX-License-Identifier: GPL-3.0-or-later
// PLY 1.0 (Stanford): ascii and binary of both endians; the vertices, other elements are passed over.
#pragma once

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {

struct PlyProperty {
  std::string name;
  ScalarType scalar = ScalarType::f32;   ///< of each entry where it is a list
  std::optional<ScalarType> list_count;  ///< type of the count, for a list
};
struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
  [[nodiscard]] bool has_list() const;
  /// Bytes of one element without list.
  [[nodiscard]] std::size_t stride() const;
};
struct PlyHeader {
  bool ascii = false, big_endian = false;
  std::vector<PlyElement> elements;
};

/// Reads up to and with end_header. Errors: Malformed (with line), Truncated.
[[nodiscard]] Result<PlyHeader> read_ply_header(Cursor& cursor);
[[nodiscard]] ReaderResult open_ply(const ByteStream& stream);

}  // namespace mapcodec
