// SPDX-License-Identifier: GPL-3.0-or-later
// What MRPT's observations see, as points.
#pragma once

#include <mrpt/obs/CObservation.h>

#include <set>
#include <string>

#include "slam_adapter/mrpt/rawlog_frame.hpp"

namespace mapcodec {

inline constexpr std::size_t kLongestLabel = 255;  ///< of a sensor; longer ones are cut

struct ProjectionSettings {
  std::uint8_t decimation = 1;  ///< of range images: one point of each block of this many pixels squared
  bool layout_alone = false;    ///< no points, only their channels: nothing is projected or loaded
};

/// Whether an observation of this class can give points.
[[nodiscard]] bool gives_points(const mrpt::obs::CObservation& o);

/// Fills class, sensor, stamp, pose, points [m, vehicle frame] and channels of `frame`: "rgb" (u8x3), or
/// "intensity" (f32) and "ring" (u16), as there are, and "time" (f64) of each point. Points are those that
/// MRPT's own maps take from the observation.
/// @return why there are none; empty where there are. What MRPT throws passes through.
[[nodiscard]] std::string take_points(mrpt::obs::CObservation& o, const ProjectionSettings& settings,
                                      RawlogFrame& frame);

}  // namespace mapcodec
