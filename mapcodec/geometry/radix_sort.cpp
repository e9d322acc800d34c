// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/radix_sort.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace mapcodec {
namespace {

constexpr int kMaxDigitBits = 11;  // 2048 counters stay in the first-level cache

void sort_by_digit(const std::vector<KeyedIndex>& from, std::vector<KeyedIndex>& to, int shift,
                   int digit_bits) {
  std::array<std::size_t, std::size_t{1} << kMaxDigitBits> start{};
  const std::uint64_t mask = (std::uint64_t{1} << digit_bits) - 1;
  for (const KeyedIndex& k : from) ++start[(k.key >> shift) & mask];
  std::size_t sum = 0;
  for (std::size_t& s : start) sum += std::exchange(s, sum);
  for (const KeyedIndex& k : from) to[start[(k.key >> shift) & mask]++] = k;
}

}  // namespace

void radix_sort(std::vector<KeyedIndex>& items, std::vector<KeyedIndex>& scratch, int bits) {
  if (items.size() < 2 || bits <= 0) return;
  scratch.resize(items.size());
  const int passes = (bits + kMaxDigitBits - 1) / kMaxDigitBits;
  const int digit_bits = (bits + passes - 1) / passes;
  for (int shift = 0; shift < bits; shift += digit_bits) {
    sort_by_digit(items, scratch, shift, std::min(digit_bits, bits - shift));
    items.swap(scratch);
  }
}

}  // namespace mapcodec
