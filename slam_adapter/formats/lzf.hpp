// SPDX-License-Identifier: GPL-3.0-or-later
// The LZF byte format of PCD's binary_compressed: a control byte below 32 starts a run of control + 1
// literals; else its upper three bits (7: plus the next byte) + 2 are a match's length, its lower five and
// the last byte the distance - 1.
#pragma once

#include "mapcodec/base/bytes.hpp"

namespace mapcodec {

/// No LZF stream grows by more than this: three bytes give at most 264.
inline constexpr std::uint64_t kLzfMaxRatio = 88;

/// Fills all of `out` from all of `in`; false if they do not fit each other. `in` may be hostile.
[[nodiscard]] bool lzf_decode(ByteSpan in, std::span<std::uint8_t> out);
/// Never longer than in.size() + in.size() / 32 + 1.
[[nodiscard]] Bytes lzf_encode(ByteSpan in);

}  // namespace mapcodec
