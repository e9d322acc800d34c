// SPDX-License-Identifier: GPL-3.0-or-later
// Does an archive still say what it said, and did it say what it promised?
#pragma once

#include <string>

#include "mapcodec/quality/evaluation.hpp"
#include "slam_adapter/formats/bag_options.hpp"
#include "slam_adapter/map_file.hpp"

namespace mapcodec {

struct VerifyOutcome {
  std::uint64_t tiles = 0, points = 0;
  std::optional<Evaluation> evaluation;  ///< with an original and a lossy promise
  std::uint64_t trailing_bytes = 0;      ///< of an update that was not finished, or not yet
  bool promise_kept = true;              ///< true without an original
  std::vector<std::string> findings;     ///< one sentence per broken promise
};

/// Every checksum, the structure of every commit, and that every tile decodes to the count the index says.
/// Errors: those of MapFile::open; ArchiveDamaged, ChecksumMismatch for the first damage found.
[[nodiscard]] Result<VerifyOutcome> verify_map(const std::string& path, const ReadSettings& settings);

/// The same, and the promise measured against the original file.
/// @param bag  of ROS bags among the originals.
/// Errors: also those of reading the original.
[[nodiscard]] Result<VerifyOutcome> verify_map_against(const std::string& path,
                                                       const std::vector<std::string>& originals,
                                                       const ReadSettings& settings,
                                                       const BagOptions& bag = {});

}  // namespace mapcodec
