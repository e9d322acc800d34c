// SPDX-License-Identifier: GPL-3.0-or-later
// VTK legacy files (ASCII, BINARY): POLYDATA, UNSTRUCTURED_GRID and STRUCTURED_GRID for their points and
// point data.
#pragma once

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {

/// One array of a VTK file that has a value per point.
struct VtkArray {
  RecordField field;         ///< where it goes in a record
  std::uint64_t offset = 0;  ///< of its first value in the file
  std::uint64_t lines = 0;   ///< lines before it (ASCII)
};
struct VtkFile {
  bool ascii = false;
  std::uint64_t points = 0;
  std::size_t stride = 0;
  std::vector<VtkArray> arrays;  ///< x, y, z first, as one array of three components
  std::vector<std::string> warnings;
};

/// Finds the arrays. Errors: Malformed, Truncated, Empty, Unsupported (data sets without points).
[[nodiscard]] Result<VtkFile> scan_vtk(Cursor& cursor);
[[nodiscard]] std::optional<ScalarType> vtk_scalar(std::string_view word);
[[nodiscard]] ReaderResult open_vtk(const ByteStream& stream);

}  // namespace mapcodec
