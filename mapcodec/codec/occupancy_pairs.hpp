// SPDX-License-Identifier: GPL-3.0-or-later
// The structure of trees with log-odds, two children at a time (FORMAT.md 12.3): somewhat more bits than
// mixed ones take, a third of their time. `Side` as in occupancy_values.hpp.
#pragma once

#include <algorithm>
#include <bit>
#include <vector>

#include "mapcodec/codec/occupancy_neighbors.hpp"
#include "mapcodec/entropy/nibble_model.hpp"

namespace mapcodec::occupancy {

/// Which children nodes have: children 2 p and 2 p + 1, which lie beside each other along x, are one symbol.
class PairModel {
 public:
  explicit PairModel(std::uint64_t inner_nodes)
      : bits_(std::clamp(static_cast<unsigned>(std::bit_width(inner_nodes)), kLeastBits, kMostBits)),
        near_(3 * 4 * 256),
        around_(std::size_t{1} << bits_) {}

  /// Codes the eight cells of node `i` of `layer`, whose side is 2^height.
  template <class Side>
  std::uint16_t code(Side& side, const Layer& layer, std::size_t i, unsigned height, std::uint32_t known) {
    const Outside out = look_around(layer, i);
    const std::uint32_t size = std::min(height, 3u) - 1;
    std::uint32_t node = 0;
    for (unsigned p = 0; p < 4; ++p) {
      const unsigned at = 4 * p;
      const Pairs y = pairs_of(node, out.y, p, 1), z = pairs_of(node, out.z, p, 2);
      const std::uint32_t x = out.x >> at & 15, place = 4 * size + p;
      const std::uint32_t key =
          x | y.nearer << 4 | z.nearer << 8 | y.farther << 12 | z.farther << 16 | place << 20;
      NibbleModel& near = near_[place << 8 | z.nearer << 4 | y.nearer];
      NibbleModel& around = around_[key * 0x9E3779B1u >> (32 - bits_)];
      node |= side.nibble(known >> at & 15, near, around) << at;
    }
    return static_cast<std::uint16_t>(node);
  }

 private:
  static constexpr unsigned kLeastBits = 6, kMostBits = 13;

  /// Along one axis: the pair that was coded before, and one behind this one if only that is outside.
  struct Pairs {
    std::uint32_t nearer, farther;
  };
  static Pairs pairs_of(std::uint32_t node, std::uint32_t outside, unsigned p, unsigned step) {
    const std::uint32_t beyond = outside >> (4 * p) & 15;
    return (p & step) == 0 ? Pairs{beyond, 0} : Pairs{node >> (4 * (p ^ step)) & 15, beyond};
  }

  unsigned bits_;
  std::vector<NibbleModel> near_, around_;
};

}  // namespace mapcodec::occupancy
