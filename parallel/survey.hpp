// SPDX-License-Identifier: GPL-3.0-or-later
// First pass over a map: everything that must be known before its first tile is coded.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mapcodec/cloud/point_stream.hpp"
#include "parallel/arena.hpp"
#include "parallel/progress.hpp"
#include "parallel/voxel_histogram.hpp"

namespace mapcodec {

struct Survey {
  std::uint64_t points = 0;     ///< that the source gave
  std::uint64_t dropped = 0;    ///< that the source left out, because a coordinate was not finite
  std::uint64_t nonfinite = 0;  ///< of `points`, those without a place: not finite, or beyond kMaxCoordinate
  Box bounds;                   ///< [m] of the points that have a place; empty if none has
  std::vector<std::optional<Bytes>>
      constant_channels;     ///< per channel: the value that all points have, if they do
  VoxelHistogram histogram;  ///< of the points that have a place
  std::vector<Vec3>
      sample;  ///< every k-th point (k a power of two), of those the ones with a place: <= 200,000
  std::optional<PointCloud> cloud;    ///< all points, if they fit half the memory budget
  PointCloud layout;                  ///< the source's
  std::vector<std::string> warnings;  ///< the source's, and what was found here
};

struct SurveySettings {
  std::uint64_t memory_budget_bytes = std::uint64_t{2}
                                      << 30;  ///< of the whole program; 0: never keep the cloud
  Arena* arena = nullptr;                     ///< nullptr: on the caller's thread
  ProgressCallback progress;
  const std::atomic<bool>* stop = nullptr;
};

/// Reads `source` from where it stands to its end. The result is the same for any number of threads.
/// Errors: those of the source; Empty if it gives no point; Cancelled; LimitExceeded when memory runs out.
[[nodiscard]] Result<Survey> survey(PointSource& source, const SurveySettings& settings);

}  // namespace mapcodec
