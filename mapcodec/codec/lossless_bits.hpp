// SPDX-License-Identifier: GPL-3.0-or-later
// Plain bits, most significant first: noise that no model would make shorter.
#pragma once

#include "mapcodec/base/bytes.hpp"

namespace mapcodec {

class BitWriter {
 public:
  /// The `count` (0..64) low bits of `v`.
  void put(std::uint64_t v, int count) {
    if (count > 32) {
      put(v >> 32, count - 32);
      count = 32;
    }
    if (count == 0) return;
    held_ = (held_ << count) | (v & (~std::uint64_t{0} >> (64 - count)));
    for (bits_ += count; bits_ >= 8; bits_ -= 8)
      bytes_.push_back(static_cast<std::uint8_t>(held_ >> (bits_ - 8)));
  }
  /// The last byte is filled up with zeros.
  [[nodiscard]] Bytes finish() {
    if (bits_ > 0) bytes_.push_back(static_cast<std::uint8_t>(held_ << (8 - bits_)));
    bits_ = 0;
    return std::move(bytes_);
  }

 private:
  Bytes bytes_;
  std::uint64_t held_ = 0;
  int bits_ = 0;
};

/// Undoes BitWriter; past the end it gives zeros, and `ok()` is false for good.
class BitReader {
 public:
  explicit BitReader(ByteSpan bytes) : bytes_(bytes) {}
  std::uint64_t get(int count) {
    if (count > 32) {
      const std::uint64_t high = get(count - 32);
      return (high << 32) | get(32);
    }
    while (bits_ < count) {
      ok_ = ok_ && at_ < bytes_.size();
      held_ = (held_ << 8) | (at_ < bytes_.size() ? bytes_[at_++] : 0);
      bits_ += 8;
    }
    bits_ -= count;
    return (held_ >> bits_) & ((std::uint64_t{1} << count) - 1);
  }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  ByteSpan bytes_;
  std::size_t at_ = 0;
  std::uint64_t held_ = 0;
  int bits_ = 0;
  bool ok_ = true;
};

}  // namespace mapcodec
