// SPDX-License-Identifier: GPL-3.0-or-later
// A log of MRPT's as points in the map's frame, for everything that reads points.
#pragma once

#include <memory>
#include <string>

#include "slam_adapter/formats/formats.hpp"

namespace mapcodec {

/// Observations are moved by the poses that the file states (keyframes, robot poses), else by its odometry;
/// where it has neither, all lie where the vehicle is the origin (with a warning). Coordinates are f32 where
/// nothing moves, else f64. The file is read once to see what it holds, then for its points.
/// Errors: those of survey_log.
[[nodiscard]] Result<std::unique_ptr<PointSource>> open_log(const std::string& path,
                                                            const ReadOptions& options);

}  // namespace mapcodec
