// SPDX-License-Identifier: GPL-3.0-or-later
// LAZ: LAS 1.0 to 1.4 as compressed by LASzip, and COPC, which is LAZ 1.4 with its chunks in the order of an
// octree. Debian has no library for it; this reader follows the LAZ specification 1.4 R1 (rapidlasso).
#pragma once

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {

/// Reads point formats 0 to 3 (coders of version 2) and 6 to 8 (versions 3 and 4) with extra bytes; gives the
/// records that LAS would hold, chunk after chunk. Errors: Truncated, Malformed, Empty, Unsupported (older
/// coders, wave packets).
[[nodiscard]] ReaderResult open_laz(const ByteStream& stream);

}  // namespace mapcodec
