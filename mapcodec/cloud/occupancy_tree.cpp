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

}  // namespace mapcodec
