// SPDX-License-Identifier: GPL-3.0-or-later
// LAS 1.0 to 1.4 (ASPRS), uncompressed.
#pragma once

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {

/// Errors: Truncated, Malformed, Empty, Unsupported (LAZ, see laz.hpp; LAS 2).
[[nodiscard]] ReaderResult open_las(const ByteStream& stream);
/// Whether a LAS header's point format is one of the compressed ones.
[[nodiscard]] bool is_laz(const ByteStream& stream);
/// KITTI Velodyne scans: float32 x, y, z, intensity and nothing else.
[[nodiscard]] ReaderResult open_kitti(const ByteStream& stream);

}  // namespace mapcodec
