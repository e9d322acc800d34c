// SPDX-License-Identifier: GPL-3.0-or-later
// Entropy decoding of LAZ: the adaptive arithmetic coder of [Said, HPL-2004-76] with 32-bit intervals, and
// the integer coder on it that LASzip uses [Isenburg, PE&RS 79(2), 2013].
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {

/// Bytes [begin, end) of a stream, through a small buffer. Past the end it gives zeros and has failed.
class LazBytes {
 public:
  LazBytes() = default;
  LazBytes(const ByteStream& stream, std::uint64_t begin, std::uint64_t end)
      : stream_(&stream), at_(begin), end_(end) {}

  std::uint8_t next() { return used_ < buffer_.size() ? buffer_[used_++] : refill(); }
  std::uint32_t u32();
  void raw(std::uint8_t* to, std::size_t count);
  /// Whether more was asked for than there is, or reading failed.
  [[nodiscard]] bool failed() const { return failed_; }
  /// Stream offset of what comes next.
  [[nodiscard]] std::uint64_t offset() const { return at_ - (buffer_.size() - used_); }

 private:
  std::uint8_t refill();

  const ByteStream* stream_ = nullptr;
  std::uint64_t at_ = 0, end_ = 0;
  Bytes buffer_;
  std::size_t used_ = 0;
  bool failed_ = false;
};

/// Adaptive probabilities of `symbols` symbols (2 to 2048), relearned ever more seldom.
class LazSymbols {
 public:
  explicit LazSymbols(std::uint32_t symbols = 256);

 private:
  friend class LazDecoder;
  void update();

  std::vector<std::uint32_t> counts_, sums_;  ///< sums_[s]: share of the symbols below s, in 2^-15
  std::uint32_t total_ = 0, cycle_ = 0, left_ = 0;
};

/// The same for a bit.
class LazBit {
 private:
  friend class LazDecoder;
  void update();
  std::uint32_t zeros_ = 1, total_ = 2, zero_share_ = 1u << 12, cycle_ = 4, left_ = 4;
};

class LazDecoder {
 public:
  /// Takes the first four bytes.
  void begin(const LazBytes& bytes);
  std::uint32_t symbol(LazSymbols& model);
  std::uint32_t bit(LazBit& model);
  /// `count` (1 to 32) bits without a model.
  std::uint32_t bits(unsigned count);
  std::uint32_t u32() { return bits(16) | bits(16) << 16; }
  [[nodiscard]] bool failed() const { return bytes_.failed(); }

 private:
  void shrink(std::uint32_t length);

  LazBytes bytes_;
  std::uint32_t value_ = 0, length_ = 0xffffffff;
};

/// Integers as corrections of a prediction: the number of bits of the correction by context, then its bits,
/// the upper eight by a model.
class LazIntegers {
 public:
  /// @param bits  8, 16 or 32.
  explicit LazIntegers(unsigned bits = 32, std::size_t contexts = 1);
  std::int32_t next(LazDecoder& from, std::int32_t prediction, std::size_t context = 0);
  /// Bits of the last correction: a measure of how well it was predicted.
  [[nodiscard]] unsigned last_bits() const { return last_bits_; }

 private:
  std::int64_t correction(LazDecoder& from, std::size_t context);

  unsigned bits_;
  std::vector<LazSymbols> lengths_;
  LazBit zero_or_one_;
  std::vector<LazSymbols> corrections_;  ///< [length - 1]
  unsigned last_bits_ = 0;
};

/// Wraps like the format's 32-bit integers do.
[[nodiscard]] inline std::int32_t wrapped_sum(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) + static_cast<std::uint32_t>(b));
}

}  // namespace mapcodec
