// SPDX-License-Identifier: GPL-3.0-or-later
// Asymmetric numeral system [Duda 2013] with 32 bits of state and 16-bit words (FORMAT.md 4.6): decodes a
// symbol of an adaptive alphabet without a division.
#pragma once

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/entropy/bit_model.hpp"
#include "mapcodec/entropy/nibble_model.hpp"

namespace mapcodec {

/// State of a code before its first symbol as the encoder sees it; the decoder must end there.
inline constexpr std::uint32_t kRansLow = 1u << 16;

/// Undoes RansEncoder. Past the end it reads zeros, and `ok()` is false for good.
class RansDecoder {
 public:
  explicit RansDecoder(ByteSpan bytes) : at_(bytes.data()), left_(bytes.size() / 2) {
    ok_ = bytes.size() % 2 == 0;
    state_ = next_word() << 16;
    state_ |= next_word();
  }

  std::uint32_t decode(NibbleModel& model) {
    const std::uint32_t symbol = decode(model.bounds());
    model.update(symbol);
    return symbol;
  }
  /// With the mean of two contexts.
  std::uint32_t decode(NibbleModel& a, NibbleModel& b) {
    const std::uint32_t symbol = decode(mean_of(a.bounds(), b.bounds()));
    a.update(symbol);
    b.update(symbol);
    return symbol;
  }
  bool decode(BitModel& model) {
    const std::uint32_t ones = model.probability() >> 1, slot = state_ & kSlots;
    const bool bit = slot < ones;
    advance(slot, bit ? 0 : ones, bit ? ones : kSlots + 1 - ones);
    model.update(bit);
    return bit;
  }
  /// `count` (0..16) bits that cost one bit each.
  std::uint32_t decode_raw(int count) {
    const std::uint32_t v = state_ & ((1u << count) - 1);
    state_ >>= count;
    refill();
    return v;
  }

  /// False once the code was read past its end. Check it inside every loop whose length the code decides.
  [[nodiscard]] bool ok() const { return ok_; }
  /// Whether the code is at the very end of what an encoder wrote: almost surely not so after damage.
  [[nodiscard]] bool finished() const { return ok_ && left_ == 0 && state_ == kRansLow; }

 private:
  static constexpr std::uint32_t kSlots = (1u << kNibbleBits) - 1;

  std::uint32_t decode(const NibbleBounds& bounds) {
    const std::uint32_t slot = state_ & kSlots;
    const std::uint32_t symbol = symbol_at(bounds, slot);
    const NibblePart part = part_of(bounds, symbol);
    advance(slot, part.start, part.size);
    return symbol;
  }
  void advance(std::uint32_t slot, std::uint32_t start, std::uint32_t frequency) {
    state_ = frequency * (state_ >> kNibbleBits) + slot - start;
    refill();
  }
  // No branch on what cannot be predicted.
  void refill() {
    const bool low = state_ < kRansLow;
    if (left_ == 0) return end(low);
    const std::uint32_t word = std::uint32_t{at_[0]} | std::uint32_t{at_[1]} << 8;
    state_ = low ? state_ << 16 | word : state_;
    at_ += low ? 2 : 0;
    left_ -= low;
  }
  void end(bool low) {
    if (!low) return;
    ok_ = false;
    state_ = kRansLow;
  }
  std::uint32_t next_word() {
    ok_ = ok_ && left_ > 0;
    if (!ok_) return 0;
    const std::uint32_t word = std::uint32_t{at_[0]} | std::uint32_t{at_[1]} << 8;
    at_ += 2;
    --left_;
    return word;
  }

  std::uint32_t state_ = 0;
  const std::uint8_t* at_;
  std::size_t left_;  ///< words
  bool ok_ = true;
};

}  // namespace mapcodec
