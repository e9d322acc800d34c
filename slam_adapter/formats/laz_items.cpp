// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/laz_items.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

// Symbols of a time: 0 to 500 and, from 501, -1 to -10 times the last difference.
constexpr std::int32_t kMostMultiple = 500, kLeastMultiple = -10;
constexpr std::int32_t kCodes = kMostMultiple - kLeastMultiple + 1;
constexpr int kExtremesToBelieve = 3;

std::int32_t times(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) * static_cast<std::uint32_t>(b));
}

}  // namespace

void LazMedian::add(std::int32_t v) {
  const std::int32_t middle = values_[2];
  if (drop_largest_) {
    std::size_t i = 4;
    for (; i > 0 && v < values_[i - 1]; --i) values_[i] = values_[i - 1];
    values_[i] = v;
    drop_largest_ = v < middle;
  } else {
    std::size_t i = 0;
    for (; i < 4 && values_[i + 1] < v; ++i) values_[i] = values_[i + 1];
    values_[i] = v;
    drop_largest_ = !(middle < v);
  }
}

std::uint32_t LazColor::corrected(LazDecoder& from, std::size_t model, int prediction) {
  return (from.symbol(models_[model]) + static_cast<std::uint32_t>(std::clamp(prediction, 0, 255))) & 0xff;
}

LazColor::Rgb LazColor::next(LazDecoder& from, const Rgb& last) {
  const std::uint32_t changed = from.symbol(changed_);
  std::array<std::array<int, 2>, 3> old{}, now{};  // low and high bytes
  for (std::size_t c = 0; c < 3; ++c) old[c] = {last[c] & 0xff, last[c] >> 8};
  now = old;
  for (std::size_t h = 0; h < 2; ++h) {
    if (changed >> h & 1) now[0][h] = static_cast<int>(corrected(from, h, old[0][h]));
  }
  const bool is_grey = (changed >> 6 & 1) == 0;
  for (std::size_t h = 0; h < 2 && !is_grey; ++h) {
    int moved = now[0][h] - old[0][h];
    if (changed >> (2 + h) & 1) now[1][h] = static_cast<int>(corrected(from, 2 + h, moved + old[1][h]));
    if ((changed >> (4 + h) & 1) == 0) continue;
    moved = (moved + now[1][h] - old[1][h]) / 2;
    now[2][h] = static_cast<int>(corrected(from, 4 + h, moved + old[2][h]));
  }
  if (is_grey) now[1] = now[2] = now[0];
  Rgb r;
  for (std::size_t c = 0; c < 3; ++c) r[c] = static_cast<std::uint16_t>(now[c][1] << 8 | now[c][0]);
  return r;
}

LazTime::LazTime(bool can_stay, std::uint64_t first)
    : can_stay_(can_stay), from_zero_(can_stay ? 6 : 5), multiple_(can_stay ? kCodes + 5 : kCodes + 4) {
  times_[0] = first;
}

std::uint64_t LazTime::next(LazDecoder& from) {
  // A broken stream may change sequences for ever; it runs dry at some time.
  while (!from.failed() && (differences_[at_] == 0 ? step_from_zero(from) : step(from))) {
  }
  return times_[at_];
}

bool LazTime::step_from_zero(LazDecoder& from) {
  const auto symbol = static_cast<std::int32_t>(from.symbol(from_zero_)) - (can_stay_ ? 1 : 0);
  if (symbol < 0) return false;
  if (symbol == 0) {
    differences_[at_] = integers_.next(from, 0, 0);
    times_[at_] += static_cast<std::uint64_t>(std::int64_t{differences_[at_]});
    extremes_[at_] = 0;
    return false;
  }
  if (symbol == 1) {
    whole(from);
    return false;
  }
  at_ = (at_ + static_cast<std::size_t>(symbol) - 1) & 3;
  return true;
}

bool LazTime::step(LazDecoder& from) {
  const auto symbol = static_cast<std::int32_t>(from.symbol(multiple_));
  if (symbol < kCodes) {
    add_multiple(from, symbol);
    return false;
  }
  const std::int32_t rest = symbol - kCodes - (can_stay_ ? 1 : 0);
  if (rest < 0) return false;
  if (rest == 0) {
    whole(from);
    return false;
  }
  at_ = (at_ + static_cast<std::size_t>(rest)) & 3;
  return true;
}

void LazTime::add_multiple(LazDecoder& from, std::int32_t code) {
  const std::int32_t multiple = code <= kMostMultiple ? code : kMostMultiple - code;
  const std::size_t context = multiple == 0                ? 7
                              : multiple == 1              ? 1
                              : multiple == kLeastMultiple ? 6
                              : multiple < 0               ? 5
                              : multiple == kMostMultiple  ? 4
                              : multiple < 10              ? 2
                                                           : 3;
  const std::int32_t difference = integers_.next(from, times(multiple, differences_[at_]), context);
  times_[at_] += static_cast<std::uint64_t>(std::int64_t{difference});
  if (multiple == 1) extremes_[at_] = 0;
  if (context != 7 && context != 6 && context != 4) return;
  if (++extremes_[at_] > kExtremesToBelieve) {
    differences_[at_] = difference;
    extremes_[at_] = 0;
  }
}

void LazTime::whole(LazDecoder& from) {
  newest_ = (newest_ + 1) & 3;
  const auto upper = static_cast<std::int32_t>(times_[at_] >> 32);
  const auto high = static_cast<std::uint32_t>(integers_.next(from, upper, 8));
  times_[newest_] = std::uint64_t{high} << 32 | from.u32();
  at_ = newest_;
  differences_[at_] = 0;
  extremes_[at_] = 0;
}

}  // namespace mapcodec
