// SPDX-License-Identifier: GPL-3.0-or-later
// Binary range coder [Martin 1979; Subbotin 1999]: 64-bit low and range, carries run into the bytes already
// written, 32 bits leave at a time (FORMAT.md 4.1).
#pragma once

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/entropy/bit_model.hpp"

namespace mapcodec {

class RangeEncoder {
 public:
  /// Codes `bit`, whose probability of being 1 is `p1` / 65536 (0 < p1 < 65536).
  void encode(bool bit, std::uint32_t p1) {
    const std::uint64_t bound = (range_ >> 16) * p1;
    const std::uint64_t zero = std::uint64_t{bit} - 1;  // all ones for a 0
    add(bound & zero);
    range_ = bit ? bound : range_ - bound;
    if (range_ < kRenormalise) shift_out();
  }
  void encode(bool bit, BitModel& model) {
    encode(bit, model.probability());
    model.update(bit);
  }
  /// The `count` (0..64) low bits of `v`, most significant first, each costing one bit.
  void encode_raw(std::uint64_t v, int count) {
    for (; count > kRawBits; count -= kRawBits) raw_step(v >> (count - kRawBits), kRawBits);
    if (count > 0) raw_step(v, count);
  }

  /// Bytes written so far (what finish() adds is at most 8).
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }

  /// The code's bytes; up to eight trailing zero bytes are left out, since a decoder assumes them.
  [[nodiscard]] Bytes finish() {
    if (low_ != 0) write_shortest();
    for (int cut = 0; cut < 8 && !bytes_.empty() && bytes_.back() == 0; ++cut) bytes_.pop_back();
    low_ = 0;
    range_ = ~std::uint64_t{0};
    return std::move(bytes_);
  }

 private:
  static constexpr std::uint64_t kRenormalise = std::uint64_t{1} << 32;
  static constexpr int kRawBits = 16;

  void raw_step(std::uint64_t v, int count) {
    range_ >>= count;
    add((v & ((std::uint64_t{1} << count) - 1)) * range_);
    if (range_ < kRenormalise) shift_out();
  }
  void add(std::uint64_t amount) {
    low_ += amount;
    if (low_ < amount) carry();
  }
  void carry() {
    for (std::size_t i = bytes_.size(); i-- > 0 && ++bytes_[i] == 0;) {
    }
  }
  void shift_out() {
    const std::uint8_t out[4] = {static_cast<std::uint8_t>(low_ >> 56), static_cast<std::uint8_t>(low_ >> 48),
                                 static_cast<std::uint8_t>(low_ >> 40),
                                 static_cast<std::uint8_t>(low_ >> 32)};
    bytes_.insert(bytes_.end(), out, out + 4);
    low_ <<= 32;
    range_ <<= 32;
  }
  // The value in [low, low + range) with the most trailing zero bytes.
  void write_shortest() {
    for (int n = 1; n <= 8; ++n) {
      const std::uint64_t below = n == 8 ? 0 : ~std::uint64_t{0} >> (8 * n);
      const std::uint64_t v = (low_ + below) & ~below;
      if (v - low_ >= range_) continue;
      if (v < low_) carry();
      for (int i = 0; i < n; ++i) bytes_.push_back(static_cast<std::uint8_t>(v >> (56 - 8 * i)));
      return;
    }
  }

  std::uint64_t low_ = 0;
  std::uint64_t range_ = ~std::uint64_t{0};
  Bytes bytes_;
};

}  // namespace mapcodec
