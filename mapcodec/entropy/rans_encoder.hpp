// SPDX-License-Identifier: GPL-3.0-or-later
// Asymmetric numeral system [Duda 2013] with 32 bits of state and 16-bit words (FORMAT.md 4.6).
#pragma once

#include <algorithm>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/entropy/rans_decoder.hpp"

namespace mapcodec {

/// Keeps what is to be coded until finish(): such a code is written from its end to its beginning.
class RansEncoder {
 public:
  void encode(std::uint32_t symbol, NibbleModel& model) {
    push(part_of(model.bounds(), symbol));
    model.update(symbol);
  }
  /// With the mean of two contexts.
  void encode(std::uint32_t symbol, NibbleModel& a, NibbleModel& b) {
    push(part_of(mean_of(a.bounds(), b.bounds()), symbol));
    a.update(symbol);
    b.update(symbol);
  }
  void encode(bool bit, BitModel& model) {
    const std::uint32_t ones = model.probability() >> 1, all = 1u << kNibbleBits;
    push(bit ? NibblePart{0, ones} : NibblePart{ones, all - ones});
    model.update(bit);
  }
  /// The `count` (0..16) low bits of `v`.
  void encode_raw(std::uint32_t v, int count) {
    if (count == 0) return;
    steps_.push_back({static_cast<std::uint16_t>(v & ((1u << count) - 1)),
                      static_cast<std::uint16_t>(kRaw | static_cast<unsigned>(count))});
  }

  [[nodiscard]] Bytes finish() {
    Bytes out;
    std::uint32_t state = kRansLow;
    const auto emit = [&] {
      out.push_back(static_cast<std::uint8_t>(state >> 8));
      out.push_back(static_cast<std::uint8_t>(state));
      state >>= 16;
    };
    for (std::size_t i = steps_.size(); i-- > 0;) {
      const Step& s = steps_[i];
      if ((s.frequency & kRaw) != 0) {
        const unsigned count = s.frequency & 31u;
        if (state >> (32 - count) != 0) emit();
        state = state << count | s.start;
      } else {
        const std::uint32_t f = s.frequency;
        if (state >= f << 17) emit();
        state = ((state / f) << kNibbleBits) + state % f + s.start;
      }
    }
    emit();
    emit();
    std::reverse(out.begin(), out.end());
    steps_.clear();
    return out;
  }

 private:
  void push(const NibblePart& p) {
    steps_.push_back({static_cast<std::uint16_t>(p.start), static_cast<std::uint16_t>(p.size)});
  }

  static constexpr std::uint16_t kRaw = 0x8000;
  struct Step {
    std::uint16_t start;      ///< of raw bits: their value
    std::uint16_t frequency;  ///< of raw bits: kRaw and how many
  };
  std::vector<Step> steps_;
};

}  // namespace mapcodec
