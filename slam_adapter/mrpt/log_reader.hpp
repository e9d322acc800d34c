// SPDX-License-Identifier: GPL-3.0-or-later
// Walks through MRPT's files object by object: rawlogs of both kinds, simplemaps, serialised maps. Memory is
// bounded by the largest object.
#pragma once

#include <functional>
#include <set>
#include <string>

#include "mapcodec/base/result.hpp"
#include "slam_adapter/mrpt/rawlog_frame.hpp"

namespace mapcodec {

struct LogSettings {
  std::set<std::string> sensors;  ///< labels of those that are wanted; empty: all
  std::uint64_t skip = 0;         ///< observations before this number are passed over
  std::uint8_t decimation = 1;    ///< of range images
  bool list = false;              ///< frames without their points
  bool match_scans = false;       ///< poses from MRPT's 2D ICP
};

/// Hands the observations that give points to `emit`, in the order of the file. In a list, robot poses of the
/// log come, too, as frames without channels.
/// Errors (with the byte of the unpacked stream): those of ObjectArchive; Truncated; Malformed (no object
/// where one must be, an object that contradicts itself, naming its class); Unsupported (written by a newer
/// MRPT); LimitExceeded (out of memory); what `emit` returns. What came before an error has been handed over.
[[nodiscard]] Result<RawlogSummary> read_log(const std::string& path, const LogSettings& settings,
                                             const std::function<Status(RawlogFrame&&)>& emit);

}  // namespace mapcodec
