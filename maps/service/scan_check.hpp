// SPDX-License-Identifier: GPL-3.0-or-later
// Scans come from anybody: what is asked of them before they may wait for a commit.
#pragma once

#include "maps/service/map_service.hpp"

namespace mapcodec {

/// Tiles that one scan may touch: what is spread wider is no scan.
inline constexpr std::uint64_t kMaxScanTiles = 65536;

/// Moves the points of `scan` into the frame of their submap and checks them.
/// Errors: InvalidArgument (a coordinate that is not finite or has no tile, a pose, names, a pose for no
/// submap), LimitExceeded (points, tiles), Malformed (channels of another size than the points; and what the
/// map's schema asks, MapCoding::check).
[[nodiscard]] Status prepare_scan(Scan& scan, const MapSchema& schema, const ServiceSettings& settings,
                                  const MapCoding& coding);

}  // namespace mapcodec
