// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/cloud/occupancy_tree.hpp"

#include <bit>

namespace mapcodec {

std::uint64_t OccupancyTree::inner_count() const {
  std::uint64_t n = 0;
  for (const OccupancyLevel& l : levels) n += l.nodes.size();
  return n;
}

std::uint64_t OccupancyTree::leaf_count() const {
  std::uint64_t n = root == Cell::free || root == Cell::occupied ? 1 : 0;
  for (const OccupancyLevel& l : levels) {
    for (const std::uint16_t node : l.nodes) n += static_cast<std::uint64_t>(std::popcount(leaf_bits(node)));
  }
  return n;
}

std::uint64_t OccupancyTree::leaf_count(Cell state) const {
  std::uint64_t n = root == state ? 1 : 0;
  for (const OccupancyLevel& l : levels) {
    for (const std::uint16_t node : l.nodes) {
      const std::uint32_t own = state == Cell::occupied ? node >> 1 : node;
      n += static_cast<std::uint64_t>(std::popcount(leaf_bits(node) & own));
    }
  }
  return n;
}

Cell cell_of_value(std::uint32_t float_bits) {
  return std::bit_cast<float>(float_bits) < 0 ? Cell::free : Cell::occupied;
}

void NodeSummary::add(std::uint32_t value, const OccupancyColor& color) {
  const auto v = std::bit_cast<float>(value);
  if (v > largest_) largest_ = v;
  if (color == kNoColor) return;
  ++colored_;
  for (std::size_t d = 0; d < 3; ++d) sum_[d] += color[d];
}

std::uint32_t NodeSummary::value() const {
  return std::bit_cast<std::uint32_t>(largest_);
}

OccupancyColor NodeSummary::color() const {
  if (colored_ == 0) return kNoColor;
  return {static_cast<std::uint8_t>(sum_[0] / colored_), static_cast<std::uint8_t>(sum_[1] / colored_),
          static_cast<std::uint8_t>(sum_[2] / colored_)};
}

}  // namespace mapcodec
