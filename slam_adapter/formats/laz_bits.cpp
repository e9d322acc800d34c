// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/laz_bits.hpp"

#include <algorithm>
#include <limits>

namespace mapcodec {
namespace {

constexpr unsigned kShareBits = 15, kBitShareBits = 13;
constexpr std::uint32_t kShortest = 1u << 24;  ///< an interval below it takes in the next byte
constexpr unsigned kModelledBits = 8;

}  // namespace

std::uint8_t LazBytes::refill() {
  constexpr std::uint64_t kBlock = 1u << 14;
  buffer_.resize(static_cast<std::size_t>(std::min(kBlock, end_ - std::min(at_, end_))));
  used_ = 0;
  if (!buffer_.empty()) {
    const auto got = stream_->read_at(at_, buffer_.data(), buffer_.size());
    buffer_.resize(got.ok() ? *got : 0);
  }
  at_ += buffer_.size();
  failed_ = failed_ || buffer_.empty();
  return buffer_.empty() ? std::uint8_t{0} : buffer_[used_++];
}

std::uint32_t LazBytes::u32() {
  std::uint32_t v = 0;
  for (unsigned i = 0; i < 4; ++i) v |= std::uint32_t{next()} << (8 * i);
  return v;
}

void LazBytes::raw(std::uint8_t* to, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) to[i] = next();
}

LazSymbols::LazSymbols(std::uint32_t symbols) : counts_(symbols, 1), sums_(symbols), cycle_(symbols) {
  update();
  cycle_ = left_ = (symbols + 6) >> 1;
}

void LazSymbols::update() {
  const auto symbols = static_cast<std::uint32_t>(counts_.size());
  total_ += cycle_;
  if (total_ > 1u << kShareBits) {
    total_ = 0;
    for (std::uint32_t& c : counts_) total_ += c = (c + 1) >> 1;
  }
  const std::uint32_t scale = 0x80000000u / total_;
  std::uint32_t sum = 0;
  for (std::uint32_t s = 0; s < symbols; ++s) {
    sums_[s] = (scale * sum) >> (31 - kShareBits);
    sum += counts_[s];
  }
  left_ = cycle_ = std::min((5 * cycle_) >> 2, (symbols + 6) << 3);
}

void LazBit::update() {
  total_ += cycle_;
  if (total_ > 1u << kBitShareBits) {
    total_ = (total_ + 1) >> 1;
    zeros_ = (zeros_ + 1) >> 1;
    if (zeros_ == total_) ++total_;
  }
  zero_share_ = (zeros_ * (0x80000000u / total_)) >> (31 - kBitShareBits);
  left_ = cycle_ = std::min((5 * cycle_) >> 2, 64u);
}

void LazDecoder::begin(const LazBytes& bytes) {
  bytes_ = bytes;
  length_ = 0xffffffff;
  value_ = 0;
  for (int i = 0; i < 4; ++i) value_ = value_ << 8 | bytes_.next();
}

void LazDecoder::shrink(std::uint32_t length) {
  length_ = length;
  while (length_ < kShortest) {
    value_ = value_ << 8 | bytes_.next();
    length_ <<= 8;
  }
}

std::uint32_t LazDecoder::symbol(LazSymbols& m) {
  const std::uint32_t unit = length_ >> kShareBits;
  const std::uint32_t share = value_ / unit;
  const auto above = std::upper_bound(m.sums_.begin() + 1, m.sums_.end(), share);
  const auto s = static_cast<std::uint32_t>(above - m.sums_.begin()) - 1;
  const std::uint32_t low = m.sums_[s] * unit;
  const std::uint32_t high = above == m.sums_.end() ? length_ : *above * unit;
  value_ -= low;
  shrink(high - low);
  ++m.counts_[s];
  if (--m.left_ == 0) m.update();
  return s;
}

std::uint32_t LazDecoder::bit(LazBit& m) {
  const std::uint32_t middle = m.zero_share_ * (length_ >> kBitShareBits);
  const bool one = value_ >= middle;
  if (one) value_ -= middle;
  if (!one) ++m.zeros_;
  shrink(one ? length_ - middle : middle);
  if (--m.left_ == 0) m.update();
  return one ? 1 : 0;
}

std::uint32_t LazDecoder::bits(unsigned count) {
  if (count > 19) {  // more would leave an interval without precision
    const std::uint32_t low = bits(16);
    return bits(count - 16) << 16 | low;
  }
  const std::uint32_t unit = length_ >> count;
  // A broken stream may point beyond the interval.
  const std::uint32_t v = std::min(value_ / unit, (1u << count) - 1);
  value_ -= v * unit;
  shrink(unit);
  return v;
}

LazIntegers::LazIntegers(unsigned bits, std::size_t contexts)
    : bits_(bits), lengths_(contexts, LazSymbols(bits + 1)) {
  for (unsigned i = 1; i <= bits; ++i) corrections_.emplace_back(1u << std::min(i, kModelledBits));
}

std::int64_t LazIntegers::correction(LazDecoder& from, std::size_t context) {
  last_bits_ = from.symbol(lengths_[context]);
  const unsigned k = last_bits_;
  if (k == 0) return from.bit(zero_or_one_);
  if (k == 32) return std::numeric_limits<std::int32_t>::min();
  std::int64_t c = from.symbol(corrections_[k - 1]);
  if (k > kModelledBits) c = c << (k - kModelledBits) | from.bits(k - kModelledBits);
  // The upper half of k bits stands for 2^(k-1) + 1 to 2^k, the lower for their negatives and one more.
  const std::int64_t half = std::int64_t{1} << (k - 1);
  return c >= half ? c + 1 : c - (2 * half - 1);
}

std::int32_t LazIntegers::next(LazDecoder& from, std::int32_t prediction, std::size_t context) {
  const auto v = static_cast<std::int32_t>(static_cast<std::uint32_t>(prediction) +
                                           static_cast<std::uint32_t>(correction(from, context)));
  if (bits_ == 32) return v;
  const std::int32_t range = std::int32_t{1} << bits_;
  return v < 0 ? v + range : v >= range ? v - range : v;
}

}  // namespace mapcodec
