// SPDX-License-Identifier: GPL-3.0-or-later
// An archive in, a file of points out.
#pragma once

#include <string>

#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/map_file.hpp"

namespace mapcodec {

struct DecompressReport {
  std::uint64_t points = 0;
  std::uint64_t tiles_read = 0;
  std::uint64_t bytes_read = 0;  ///< of the archive, its index included
  double seconds = 0;
  double first_point_seconds = 0;  ///< from opening the archive to the first decoded points
};

/// Writes the points of `region` to `path`, in the format its extension names, and in their first order where
/// the archive keeps it. There is never a half file. Errors: those of MapFile::read; InvalidArgument (unknown
/// extension); Empty (no point in the region); CannotWrite.
[[nodiscard]] Result<DecompressReport> decompress(const std::string& map_path, const std::string& path,
                                                  const Region& region, std::optional<std::uint64_t> revision,
                                                  const ReadSettings& settings,
                                                  const WriteOptions& write = {});

}  // namespace mapcodec
