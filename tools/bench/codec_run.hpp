// SPDX-License-Identifier: GPL-3.0-or-later
// Our own codec, there and back, with everything that can be measured about it.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "slam_adapter/compress.hpp"

namespace mapcodec::bench {

struct CodecRun {
  CompressReport report;
  std::uint64_t archive_bytes = 0, raw_bytes = 0;
  double encode_seconds = 0;                ///< processor time of all tiles together
  double decode_seconds = 0;                ///< the same for decoding, fetching included
  std::vector<double> tile_decode_seconds;  ///< in Morton order
  double surface_share = 0;                 ///< of the points, those in `surface` tiles
  double stated_farthest_m = 0;             ///< what the archive says that no point is farther off than
  double tile_size_m = 0;
  Vec3 origin{};  ///< where tiles begin
  PointCloud decoded;
};

/// Compresses `cloud` to an archive at `scratch`, decodes it tile by tile, and removes it.
/// Errors: those of compress and of reading.
[[nodiscard]] Result<CodecRun> run_codec(const PointCloud& cloud, const CompressOptions& options,
                                         const std::string& scratch);

}  // namespace mapcodec::bench
