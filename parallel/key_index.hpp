// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "mapcodec/cloud/tile_key.hpp"

namespace mapcodec {

/// Numbers tile keys 0, 1, 2, ... as they are added. Open addressing in one array: the lookup stands in the
/// loop over all points of a map.
class KeyIndex {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  /// The number of `key`, or kNone.
  [[nodiscard]] std::uint32_t find(const TileKey& key) const {
    if (slots_.empty()) return kNone;
    const std::size_t mask = slots_.size() - 1;
    std::size_t s = TileKeyHash{}(key)&mask;
    while (slots_[s] != kNone && !(keys_[slots_[s]] == key)) s = (s + 1) & mask;
    return slots_[s];
  }
  /// The number of `key`, which is added if it is new.
  std::uint32_t add(const TileKey& key) {
    const std::uint32_t known = find(key);
    if (known != kNone) return known;
    keys_.push_back(key);
    if (keys_.size() * 2 > slots_.size()) {
      rebuild();
    } else {
      place(static_cast<std::uint32_t>(keys_.size() - 1));
    }
    return static_cast<std::uint32_t>(keys_.size() - 1);
  }
  /// In the order in which they were added.
  [[nodiscard]] const std::vector<TileKey>& keys() const { return keys_; }

 private:
  void place(std::uint32_t number) {
    const std::size_t mask = slots_.size() - 1;
    std::size_t s = TileKeyHash{}(keys_[number]) & mask;
    while (slots_[s] != kNone) s = (s + 1) & mask;
    slots_[s] = number;
  }
  void rebuild() {
    slots_.assign(slots_.empty() ? 64 : slots_.size() * 2, kNone);
    for (std::uint32_t i = 0; i < keys_.size(); ++i) place(i);
  }

  std::vector<TileKey> keys_;
  std::vector<std::uint32_t> slots_;
};

}  // namespace mapcodec
