// SPDX-License-Identifier: GPL-3.0-or-later
// E57 of ASTM E2807: pages with checksums, a description in XML, points as bit streams in packets. Debian has
// no library for it.
#pragma once

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {

/// All scans of the file as one cloud, each where its pose puts it. Cartesian and spherical coordinates as
/// float, double, integer and scaled integer; colour, intensity, normals, row, column, time, return numbers
/// and other numbers as channels; points that are marked invalid are skipped. What not all scans have is left
/// out, as are images (both said in warnings). Coordinates stay f32 or fixed where one scan without a pose
/// stores them so.
/// Errors: Truncated, Malformed (also a page whose checksum does not fit), Empty, Unsupported (text as a
/// point's field, structures in points).
[[nodiscard]] ReaderResult open_e57(const ByteStream& stream);

}  // namespace mapcodec
