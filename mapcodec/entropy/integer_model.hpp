// SPDX-License-Identifier: GPL-3.0-or-later
// Integers of any size over adaptive binary contexts: bit length in unary, then the two bits below the
// leading one in the context of the length, the rest raw (FORMAT.md 4.3).
#pragma once

#include <algorithm>
#include <bit>

#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/entropy/range_decoder.hpp"
#include "mapcodec/entropy/range_encoder.hpp"

namespace mapcodec {

/// One context of an unsigned integer; small values are cheap, large ones possible.
class IntegerModel {
 public:
  void encode(RangeEncoder& out, std::uint64_t v) {
    const int length = std::bit_width(v);  // 0..64
    encode_length(out, static_cast<std::uint32_t>(length));
    if (length < 2) return;
    const int modelled = std::min(length - 1, kModelledBits);
    std::uint32_t node = 1;
    for (int i = 0; i < modelled; ++i) {
      const bool bit = ((v >> (length - 2 - i)) & 1) != 0;
      out.encode(bit, mantissa_[static_cast<std::size_t>(length)][node]);
      node = node * 2 + bit;
    }
    out.encode_raw(v, length - 1 - modelled);
  }

  std::uint64_t decode(RangeDecoder& in) {
    const int length = static_cast<int>(decode_length(in));
    if (length < 2) return static_cast<std::uint64_t>(length);
    if (length > 64) return 0;
    const int modelled = std::min(length - 1, kModelledBits);
    std::uint64_t v = 1;
    std::uint32_t node = 1;
    for (int i = 0; i < modelled; ++i) {
      const bool bit = in.decode(mantissa_[static_cast<std::size_t>(length)][node]);
      node = node * 2 + bit;
      v = v * 2 + bit;
    }
    const int raw = length - 1 - modelled;
    return raw > 0 ? (v << raw) | in.decode_raw(raw) : v;
  }

  void encode_signed(RangeEncoder& out, std::int64_t v) { encode(out, zigzag(v)); }
  std::int64_t decode_signed(RangeDecoder& in) { return unzigzag(decode(in)); }

 private:
  static constexpr int kModelledBits = 2;

  // Unary up to 12, then a tree of six bits: greater lengths are rare.
  void encode_length(RangeEncoder& out, std::uint32_t length) {
    for (std::uint32_t i = 0; i < kUnary; ++i) {
      const bool more = length > i;
      out.encode(more, unary_[i]);
      if (!more) return;
    }
    std::uint32_t node = 1;
    for (int i = 5; i >= 0; --i) {
      const bool bit = (((length - kUnary) >> i) & 1) != 0;
      out.encode(bit, tree_[node]);
      node = node * 2 + bit;
    }
  }
  std::uint32_t decode_length(RangeDecoder& in) {
    for (std::uint32_t i = 0; i < kUnary; ++i) {
      if (!in.decode(unary_[i])) return i;
    }
    std::uint32_t node = 1;
    for (int i = 0; i < 6; ++i) node = node * 2 + in.decode(tree_[node]);
    return (node & 63) + kUnary;
  }

  static constexpr std::uint32_t kUnary = 12;
  std::array<BitModel, kUnary> unary_{};
  std::array<BitModel, 64> tree_{};
  std::array<std::array<BitModel, 4>, 65> mantissa_{};
};

}  // namespace mapcodec
