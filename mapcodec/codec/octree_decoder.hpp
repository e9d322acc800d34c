// SPDX-License-Identifier: GPL-3.0-or-later
// Decoder of the context-coded octree (FORMAT.md 6.2).
#pragma once

#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"

namespace mapcodec {

struct DecodedOctree {
  std::vector<std::uint64_t> keys;    ///< Morton keys of the occupied cells, strictly ascending
  std::vector<std::uint32_t> counts;  ///< points of each, at least 1; their sum is `points`
};

/// Decodes what encode_octree wrote.
/// @param bytes   may be hostile.
/// @param points  sum of all counts (with counts off: number of keys).
/// @param depth   as given to encode_octree.
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<DecodedOctree> decode_octree(ByteSpan bytes, std::uint64_t points, std::uint32_t depth,
                                                  const DecodeLimits& limits);

}  // namespace mapcodec
