// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace mapcodec {

/// What a decoder will believe of the bytes it is given. A breach is LimitExceeded, never a large allocation.
struct DecodeLimits {
  std::uint64_t max_points = std::uint64_t{1} << 28;  ///< points of one tile
  std::uint64_t max_bytes = std::uint64_t{1} << 33;   ///< memory that decoding one tile may take [bytes]
  std::uint32_t max_channels = 256;                   ///< channels of one map
};

}  // namespace mapcodec
