// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/entropy/bit_model.hpp"

namespace mapcodec {

/// Undoes RangeEncoder. Past the end it assumes zeros, as many as an honest code can need; after that the
/// bytes are damaged, and `ok()` is false for good.
class RangeDecoder {
 public:
  explicit RangeDecoder(ByteSpan bytes) : at_(bytes.data()), left_(bytes.size()) {
    code_ = next_word() << 32;
    code_ |= next_word();
  }

  bool decode(std::uint32_t p1) { return decode_mask(p1) != 0; }
  bool decode(BitModel& model) {
    const std::uint32_t one = decode_mask(model.probability());
    model.learn(one);
    return one != 0;
  }
  /// The bit as a mask: all ones or zero.
  std::uint32_t decode_mask(std::uint32_t p1) {
    const std::uint64_t bound = (range_ >> 16) * p1;
    // No branch on what cannot be predicted.
    const std::uint64_t one = 0 - static_cast<std::uint64_t>(code_ < bound);
    const std::uint64_t rest = range_ - bound;
    code_ = (code_ - bound) + (bound & one);
    range_ = rest ^ ((rest ^ bound) & one);
    if (range_ < kRenormalise) shift_in();
    return static_cast<std::uint32_t>(one);
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
  /// Bytes not read yet.
  [[nodiscard]] std::size_t left() const { return left_; }

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
    const std::size_t taken = left_ < 4 ? left_ : 4;
    const std::uint64_t v = taken == 4 ? std::uint64_t{at_[0]} << 24 | std::uint64_t{at_[1]} << 16 |
                                             std::uint64_t{at_[2]} << 8 | at_[3]
                                       : last_word(at_, taken);
    at_ += taken;
    left_ -= taken;
    assumed_ += static_cast<std::uint32_t>(4 - taken);
    if (assumed_ > kAssumedLimit) assumed_ = kAssumedLimit + 1;
    return v;
  }
  // Static, so that a decoder in a local variable can stay in registers.
  static std::uint64_t last_word(const std::uint8_t* at, std::size_t count) {
    std::uint64_t v = 0;
    for (std::size_t i = 0; i < 4; ++i) v = (v << 8) | (i < count ? at[i] : 0);
    return v;
  }

  std::uint64_t range_ = ~std::uint64_t{0};
  std::uint64_t code_ = 0;
  const std::uint8_t* at_;
  std::size_t left_;
  std::uint32_t assumed_ = 0;
};

}  // namespace mapcodec
