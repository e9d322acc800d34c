// SPDX-License-Identifier: GPL-3.0-or-later
// The other side of ByteWriter: bounds-checked, and failed for good after the first read past the end.
#pragma once

#include <bit>
#include <string>

#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// Reads fields from hostile bytes. After a failed read every further read returns 0 / empty and `ok()` is
/// false: check `ok()` (or `status()`) before believing what was read, and before allocating by it.
class ByteReader {
 public:
  explicit ByteReader(ByteSpan bytes) : bytes_(bytes) {}

  std::uint8_t u8() { return static_cast<std::uint8_t>(little_endian(1)); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(little_endian(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(little_endian(4)); }
  std::uint64_t u64() { return little_endian(8); }
  float f32() { return std::bit_cast<float>(u32()); }
  double f64() { return std::bit_cast<double>(u64()); }

  std::uint64_t varint() {
    std::uint64_t v = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const std::uint8_t b = u8();
      if (!ok_ || (shift == 63 && b > 1)) return fail();
      v |= static_cast<std::uint64_t>(b & 0x7f) << shift;
      if (b < 0x80) return v;
    }
    return fail();
  }
  std::int64_t signed_varint() { return unzigzag(varint()); }

  /// `count` bytes as a view into the input; empty and failed if fewer are left.
  ByteSpan raw(std::uint64_t count) {
    if (!ok_ || count > left()) {
      fail();
      return {};
    }
    const ByteSpan v = bytes_.subspan(at_, count);
    at_ += count;
    return v;
  }
  ByteSpan sized() { return raw(varint()); }
  std::string text() {
    const ByteSpan v = sized();
    return {v.begin(), v.end()};
  }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t left() const { return ok_ ? bytes_.size() - at_ : 0; }
  [[nodiscard]] std::size_t offset() const { return at_; }
  /// Truncated, naming `what`, if any read so far failed.
  [[nodiscard]] Status status(const char* what) const {
    if (ok_) return {};
    return make_error(ErrorCode::kTruncated, std::string(what) + " ends too early or holds a broken number",
                      at_);
  }

 private:
  std::uint64_t fail() {
    ok_ = false;
    return 0;
  }
  std::uint64_t little_endian(std::size_t count) {
    if (!ok_ || count > bytes_.size() - at_) return fail();
    std::uint64_t v = 0;
    for (std::size_t i = 0; i < count; ++i) v |= static_cast<std::uint64_t>(bytes_[at_ + i]) << (8 * i);
    at_ += count;
    return v;
  }

  ByteSpan bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace mapcodec
