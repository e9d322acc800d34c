// SPDX-License-Identifier: GPL-3.0-or-later
// Encoder of a context-coded octree: which cells of a cube are occupied, and how many points each holds.
#pragma once

#include <span>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

struct OctreeSettings {
  Effort effort = Effort::standard;
  bool keep_counts = true;  ///< false: `counts` is ignored and all are decoded as 1
};

/// @param keys    Morton keys (geometry/morton.hpp), strictly ascending, not empty, each below 8^depth.
/// @param counts  points of each key, at least 1; as many as keys (may be empty if keep_counts is off).
/// @param depth   0..21 levels.
/// Threads: pure; same input, same bytes.
[[nodiscard]] Bytes encode_octree(std::span<const std::uint64_t> keys, std::span<const std::uint32_t> counts,
                                  std::uint32_t depth, const OctreeSettings& settings);

}  // namespace mapcodec
