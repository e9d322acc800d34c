// SPDX-License-Identifier: GPL-3.0-or-later
// The one name for raw bytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace mapcodec {

using Bytes = std::vector<std::uint8_t>;
using ByteSpan = std::span<const std::uint8_t>;

}  // namespace mapcodec
