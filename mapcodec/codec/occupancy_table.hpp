// SPDX-License-Identifier: GPL-3.0-or-later
// The log-odds that occur in a tile, and how they are numbered (FORMAT.md 12.1, 12.4).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "mapcodec/cloud/occupancy_tree.hpp"

namespace mapcodec::occupancy {

/// Float bits to integers that ascend with the value, and back.
[[nodiscard]] constexpr std::uint32_t to_ordered(std::uint32_t bits) {
  return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}
[[nodiscard]] constexpr std::uint32_t from_ordered(std::uint32_t v) {
  return (v & 0x80000000u) != 0 ? v & 0x7fffffffu : ~v;
}

/// Values by class (free, occupied), the frequent ones first.
class ValueTable {
 public:
  struct Entry {
    std::uint32_t bits = 0;   ///< of the float32
    std::uint8_t weight = 0;  ///< bit length of how often it occurs
  };

  ValueTable() = default;
  /// @param entries  ascending by value.
  /// @param escapes  0: no other values occur; else the bit length of how many leaves have one: 32 raw bits
  /// each.
  ValueTable(std::vector<Entry> entries, std::uint8_t escapes)
      : entries_(std::move(entries)), escapes_(escapes) {
    for (const Entry& e : entries_) ranked_[class_of(e.bits)].push_back(e);
    for (auto& r : ranked_)
      std::stable_sort(r.begin(), r.end(),
                       [](const Entry& a, const Entry& b) { return a.weight > b.weight; });
  }

  [[nodiscard]] const std::vector<Entry>& entries() const { return entries_; }
  [[nodiscard]] std::uint8_t escapes() const { return escapes_; }
  [[nodiscard]] static std::uint32_t class_of(std::uint32_t bits) {
    return cell_of_value(bits) == Cell::occupied ? 1 : 0;
  }

  /// Ranks of a class: its values, then the escape.
  [[nodiscard]] std::uint32_t ranks(std::uint32_t occupied) const {
    return static_cast<std::uint32_t>(ranked_[occupied].size()) + (escapes_ > 0 ? 1 : 0);
  }
  /// How often each rank occurs, about.
  [[nodiscard]] std::vector<std::uint64_t> weights(std::uint32_t occupied) const {
    std::vector<std::uint64_t> w;
    for (const Entry& e : ranked_[occupied]) w.push_back(std::uint64_t{1} << (e.weight - 1));
    if (escapes_ > 0) w.push_back(std::uint64_t{1} << (escapes_ - 1));
    return w;
  }
  [[nodiscard]] bool is_escape(std::uint32_t occupied, std::uint32_t rank) const {
    return escapes_ > 0 && rank == ranked_[occupied].size();
  }
  /// @param rank  of a value.
  [[nodiscard]] std::uint32_t value(std::uint32_t occupied, std::uint32_t rank) const {
    return ranked_[occupied][rank].bits;
  }

 private:
  std::vector<Entry> entries_;
  std::uint8_t escapes_ = 0;
  std::array<std::vector<Entry>, 2> ranked_;
};

}  // namespace mapcodec::occupancy
