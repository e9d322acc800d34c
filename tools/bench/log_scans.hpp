// SPDX-License-Identifier: GPL-3.0-or-later
// Logs of MRPT's as scans that can be added one by one.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"

namespace mapcodec::bench {

/// Writes each keyframe of a rawlog or simplemap as a point file [m, map frame] into `folder`, which is made.
/// Where the file states no poses, its scans are registered one with the other.
/// @return their paths, in the log's order. Errors: those of the verb `rawlog` (Unreadable); CannotWrite.
[[nodiscard]] Result<std::vector<std::string>> scans_of_log(const std::string& log,
                                                            const std::string& folder);

}  // namespace mapcodec::bench
