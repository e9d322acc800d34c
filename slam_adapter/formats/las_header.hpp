// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/cloud/point_cloud.hpp"
#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {

/// The header of LAS 1.0 to 1.4 and of LAZ, whose point format has a high bit set.
struct LasHeader {
  unsigned minor = 0, format = 0;
  std::uint64_t header_size = 0, data_offset = 0, points = 0;
  std::size_t stride = 0;
  CoordinateFormat coordinates{CoordinateFormat::Kind::fixed, {}, {}};
  bool compressed = false;     ///< LAZ
  std::uint32_t records = 0;   ///< of variable length, after the header
  bool may_have_tail = false;  ///< waveforms or extended records may follow the points
};

/// Errors: Truncated, Malformed, Empty, Unsupported (LAS 2).
[[nodiscard]] Result<LasHeader> read_las_header(const ByteStream& stream);

}  // namespace mapcodec
