// SPDX-License-Identifier: GPL-3.0-or-later
// For programs that use MRPT: its point maps and our clouds. The only headers that name MRPT's types are in
// this folder; nothing else includes them.
#pragma once

#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/maps/CPointsMap.h>
#include <mrpt/maps/CSimplePointsMap.h>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// The points of a map of MRPT's, with what its class holds beside them: "rgb" (u8x3: coloured maps),
/// "intensity" (f32: XYZI maps, coloured maps in which every point is grey stay rgb), "weight" (u32: weighted
/// maps). Coordinates are f32, bit for bit. Never fails. Threads: as reading the map.
[[nodiscard]] PointCloud cloud_of(const mrpt::maps::CPointsMap& map);

/// Replaces the points of `map`. @param cloud  [m]; coordinates become float32. Other channels are left out.
/// Errors: LimitExceeded (a coordinate beyond float32 or farther than millimetres are kept, 16 km: shift it).
[[nodiscard]] Status to_points_map(const PointCloud& cloud, mrpt::maps::CSimplePointsMap& map);
/// The same with colours, from "rgb" (u8x3 or u16x3); white without.
[[nodiscard]] Status to_points_map(const PointCloud& cloud, mrpt::maps::CColouredPointsMap& map);

}  // namespace mapcodec
