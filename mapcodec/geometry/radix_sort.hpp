// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

namespace mapcodec {

/// A sort key and the index of what it belongs to.
struct KeyedIndex {
  std::uint64_t key;
  std::uint32_t index;
};

/// Sorts by the lowest `bits` (0..64) of the key, ascending, stably: least significant digit first, in time
/// linear in the number of items. `scratch` is resized as needed. Threads: pure.
void radix_sort(std::vector<KeyedIndex>& items, std::vector<KeyedIndex>& scratch, int bits);

}  // namespace mapcodec
