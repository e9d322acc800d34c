// SPDX-License-Identifier: GPL-3.0-or-later
// What the verbs that change a map share.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "maps/submap_pose.hpp"
#include "slam_adapter/map_updater.hpp"
#include "tools/verbs/report.hpp"

namespace mapcodec::cli {

/// "x,y,z,qx,qy,qz,qw". Errors: InvalidArgument (count, not finite, quaternion not of length 1 within 1e-3;
/// it is normalised).
[[nodiscard]] Result<PoseChange> parse_pose(const std::string& text);
/// Prints what a change did: JSON, or a line for people; warnings on stderr.
void print_change(const std::string& map, const UpdateReport& report,
                  const std::vector<std::string>& warnings, double seconds, bool json);

}  // namespace mapcodec::cli
