// SPDX-License-Identifier: GPL-3.0-or-later
// Who gets how much of the memory budget: half for a map kept in memory, or a quarter for sorting what is
// spilled to disk; the rest for tiles in flight and the program itself.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// Bytes of one point in a PointCloud.
[[nodiscard]] inline std::uint64_t bytes_per_point(const PointCloud& layout) {
  std::uint64_t n = sizeof(Vec3);
  for (const Channel& c : layout.channels) n += c.info.stride();
  return n;
}

/// Sorting points into tiles takes two 32-bit numbers for each.
inline constexpr std::uint64_t kSortBytesPerPoint = 8;

/// Points that may be kept in memory from the first pass to the last tile. Indices of 32 bits limit it too.
[[nodiscard]] inline std::uint64_t points_kept_in_memory(const PointCloud& layout,
                                                         std::uint64_t budget_bytes) {
  const std::uint64_t fit = budget_bytes / 2 / (bytes_per_point(layout) + kSortBytesPerPoint);
  return std::min<std::uint64_t>(fit, std::numeric_limits<std::uint32_t>::max() - 1);
}

/// Points that are sorted at once on the way to the disk; never fewer than a block, however small the budget.
[[nodiscard]] inline std::uint64_t points_sorted_at_once(const PointCloud& layout,
                                                         std::uint64_t budget_bytes) {
  const std::uint64_t fit = budget_bytes / 4 / (bytes_per_point(layout) + kSortBytesPerPoint);
  return std::clamp<std::uint64_t>(fit, 65536, std::numeric_limits<std::uint32_t>::max() - 1);
}

/// Bytes that tiles in flight may take.
[[nodiscard]] inline std::uint64_t tiles_in_flight_bytes(std::uint64_t budget_bytes) {
  return budget_bytes / 2;
}

}  // namespace mapcodec
