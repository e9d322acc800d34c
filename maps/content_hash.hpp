// SPDX-License-Identifier: GPL-3.0-or-later
// What identifies the content of a tile across archives (FORMAT.md, Hashes).
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include "mapcodec/base/bytes.hpp"

namespace mapcodec {

/// 128 bits; equal for equal content in any archive. Finds accidents, not forgeries.
struct ContentHash {
  std::array<std::uint8_t, 16> bytes{};
  auto operator<=>(const ContentHash&) const = default;
  /// 32 hexadecimal digits.
  [[nodiscard]] std::string to_string() const;
};

/// XXH3-128 of the bytes, in its canonical (big-endian) form. Pure.
[[nodiscard]] ContentHash hash_bytes(ByteSpan bytes);

/// Of a tile: the kind of its base and the hashes of its segments, in their order. Not its place: equal
/// content in two places has one hash. Pure.
[[nodiscard]] ContentHash hash_tile(std::uint8_t codec, const std::vector<ContentHash>& segments);

}  // namespace mapcodec
