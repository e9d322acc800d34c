// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/entropy/bit_model.hpp"

namespace mapcodec {

/// Undoes RangeEncoder. Past the end it assumes zeros, as many as an honest code can need; after that the
/// bytes are damaged, and `ok()` is false for good.
class RangeDecoder {
 public:
  explicit RangeDecoder(ByteSpan bytes) : bytes_(bytes) {
    code_ = next_word() << 32;
    code_ |= next_word();
  }

  bool decode(std::uint32_t p1) {
    const std::uint64_t bound = (range_ >> 16) * p1;
    const bool bit = code_ < bound;
    const std::uint64_t zero =
        std::uint64_t{bit} - 1;  // all ones for a 0: no branch on what cannot be predicted
    code_ -= bound & zero;
    range_ = bound ^ ((bound ^ (range_ - bound)) & zero);
    if (range_ < kRenormalise) shift_in();
    return bit;
  }
  bool decode(BitModel& model) {
    const bool bit = decode(model.probability());
    model.update(bit);
    return bit;
  }
  /// `count` (0..64) bits written by encode_raw.
  std::uint64_t decode_raw(int count) {
    std::uint64_t v = 0;
    for (; count > kRawBits; count -= kRawBits) v = (v << kRawBits) | raw_step(kRawBits);
    return count > 0 ? (v << count) | raw_step(count) : v;
  }

  /// False once the code was read so far past its end that it cannot be what the encoder wrote.
  /// Check it inside every loop whose length the code itself decides.
  [[nodiscard]] bool ok() const { return assumed_ <= kAssumedLimit; }

 private:
  static constexpr std::uint64_t kRenormalise = std::uint64_t{1} << 32;
  static constexpr int kRawBits = 16;
  // Eight bytes of look-ahead and the eight zeros that the encoder may have cut.
  static constexpr std::uint32_t kAssumedLimit = 16;

  std::uint64_t raw_step(int count) {
    range_ >>= count;
    std::uint64_t v = code_ / range_;
    if ((v >> count) != 0) {  // in no honest code
      v = 0;
      code_ = 0;
      assumed_ = kAssumedLimit + 1;
    }
    code_ -= v * range_;
    if (range_ < kRenormalise) shift_in();
    return v;
  }
  void shift_in() {
    range_ <<= 32;
    code_ = (code_ << 32) | next_word();
  }
  std::uint64_t next_word() {
    std::uint64_t v = 0;
    for (int i = 0; i < 4; ++i) v = (v << 8) | next_byte();
    return v;
  }
  std::uint64_t next_byte() {
    if (at_ < bytes_.size()) return bytes_[at_++];
    assumed_ += assumed_ <= kAssumedLimit;
    return 0;
  }

  std::uint64_t range_ = ~std::uint64_t{0};
  std::uint64_t code_ = 0;
  ByteSpan bytes_;
  std::size_t at_ = 0;
  std::uint32_t assumed_ = 0;
};

}  // namespace mapcodec
