// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// Unpacks a chunk of a ROS bag.
/// @param compression  "none", "bz2" or "lz4" (an LZ4 frame).
/// @param size         of the chunk unpacked, as the bag says; memory grows with what is really there, not by
/// this.
/// Errors: Unsupported (another compression), Malformed, LimitExceeded (more than 1 GiB).
[[nodiscard]] Result<Bytes> unpack_bag_chunk(const std::string& compression, Bytes packed,
                                             std::uint32_t size);

}  // namespace mapcodec
