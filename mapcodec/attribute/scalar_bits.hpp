// SPDX-License-Identifier: GPL-3.0-or-later
// Any scalar as an unsigned integer whose order is the scalar's: what differs little in value differs little
// in number.
#pragma once

#include <bit>
#include <cstdint>
#include <type_traits>

#include "mapcodec/cloud/channel.hpp"

namespace mapcodec {

/// Unsigned: itself. Signed: the sign bit flipped. Floats: non-negative ones get the sign bit set, negative
/// ones all bits flipped, so -0 lies right below +0 and NaNs at both ends, payloads and all.
template <class T>
[[nodiscard]] constexpr std::uint64_t ordered_bits(T v) {
  if constexpr (std::is_floating_point_v<T>) {
    using U = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
    constexpr U kSign = U{1} << (sizeof(T) * 8 - 1);
    const U u = std::bit_cast<U>(v);
    return (u & kSign) != 0 ? static_cast<U>(~u) : static_cast<U>(u | kSign);
  } else if constexpr (std::is_signed_v<T>) {
    using U = std::make_unsigned_t<T>;
    constexpr U kSign = static_cast<U>(U{1} << (sizeof(T) * 8 - 1));
    return static_cast<U>(static_cast<U>(v) ^ kSign);
  } else {
    return v;
  }
}

/// Undoes ordered_bits; bits of `o` above T's width are ignored.
template <class T>
[[nodiscard]] constexpr T from_ordered_bits(std::uint64_t o) {
  if constexpr (std::is_floating_point_v<T>) {
    using U = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
    constexpr U kSign = U{1} << (sizeof(T) * 8 - 1);
    const U u = static_cast<U>(o);
    return std::bit_cast<T>((u & kSign) != 0 ? static_cast<U>(u ^ kSign) : static_cast<U>(~u));
  } else if constexpr (std::is_signed_v<T>) {
    using U = std::make_unsigned_t<T>;
    constexpr U kSign = static_cast<U>(U{1} << (sizeof(T) * 8 - 1));
    return static_cast<T>(static_cast<U>(static_cast<U>(o) ^ kSign));
  } else {
    return static_cast<T>(o);
  }
}

/// ordered_bits of component `c` of point `i`, whatever its type.
[[nodiscard]] inline std::uint64_t load_ordered(const Channel& channel, std::size_t i, std::size_t c) {
  return visit_scalar(channel.info.scalar,
                      [&](auto zero) { return ordered_bits(channel.get<decltype(zero)>(i, c)); });
}
inline void store_ordered(Channel& channel, std::size_t i, std::size_t c, std::uint64_t o) {
  visit_scalar(channel.info.scalar,
               [&](auto zero) { channel.set(i, from_ordered_bits<decltype(zero)>(o), c); });
}

}  // namespace mapcodec
