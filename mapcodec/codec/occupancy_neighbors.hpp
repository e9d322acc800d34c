// SPDX-License-Identifier: GPL-3.0-or-later
// Who lies beside whom in one level of an octree: six faces and twelve edges, inherited from the parents.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

namespace mapcodec::occupancy {

inline constexpr std::size_t kBeside = 18;
/// Offsets of the neighbours: -x +x -y +y -z +z, then the edges along z, y and x.
inline constexpr std::array<std::array<int, 3>, kBeside> kOffsets{{{-1, 0, 0},
                                                                   {1, 0, 0},
                                                                   {0, -1, 0},
                                                                   {0, 1, 0},
                                                                   {0, 0, -1},
                                                                   {0, 0, 1},
                                                                   {-1, -1, 0},
                                                                   {1, -1, 0},
                                                                   {-1, 1, 0},
                                                                   {1, 1, 0},
                                                                   {-1, 0, -1},
                                                                   {1, 0, -1},
                                                                   {-1, 0, 1},
                                                                   {1, 0, 1},
                                                                   {0, -1, -1},
                                                                   {0, 1, -1},
                                                                   {0, -1, 1},
                                                                   {0, 1, 1}}};
inline constexpr std::size_t kSelf = kBeside;  ///< stands for the node itself

/// Where to find the neighbour of a child: which neighbour of its parent, and which child of that.
struct Origin {
  std::uint8_t slot, child;
};
inline constexpr std::array<std::array<Origin, kBeside>, 8> kOrigins = [] {
  std::array<std::array<Origin, kBeside>, 8> t{};
  for (unsigned c = 0; c < 8; ++c) {
    for (std::size_t o = 0; o < kBeside; ++o) {
      std::array<int, 3> parent{};
      unsigned child = 0;
      for (unsigned d = 0; d < 3; ++d) {
        const int at = static_cast<int>(c >> d & 1) + kOffsets[o][d];
        parent[d] = at < 0 ? -1 : (at > 1 ? 1 : 0);
        child |= static_cast<unsigned>(at & 1) << d;
      }
      std::size_t slot = kSelf;
      for (std::size_t k = 0; k < kBeside; ++k) {
        if (kOffsets[k] == parent) slot = k;
      }
      t[c][o] = {static_cast<std::uint8_t>(slot), static_cast<std::uint8_t>(child)};
    }
  }
  return t;
}();

/// Indices below kFirstNode stand for space without a node: unknown, or within a larger free or occupied
/// leaf.
inline constexpr std::uint32_t kFirstNode = 4;
/// What such a place shows instead of children: eight times the same cell.
inline constexpr std::array<std::uint16_t, kFirstNode> kUniform{0x0000, 0x5555, 0xAAAA, 0xFFFF};
/// Children of a node that is not coded yet: they look like inner nodes.
inline constexpr std::uint16_t kNotYet = 0xFFFF;

struct Beside {
  std::array<std::uint32_t, kBeside> index{};  ///< of the neighbours, in the same level
};

/// Not every machine that this is built for counts bits.
inline constexpr std::array<std::uint8_t, 256> kBitCount = [] {
  std::array<std::uint8_t, 256> t{};
  for (unsigned i = 1; i < 256; ++i) t[i] = static_cast<std::uint8_t>(t[i / 2] + (i & 1));
  return t;
}();
/// How many of the (even) bits of `bits` belong to children before `child` (8: to all).
[[nodiscard]] inline std::uint32_t rank_of(std::uint32_t bits, unsigned child) {
  const std::uint32_t before = bits & ((1u << (2 * child)) - 1);
  return std::uint32_t{kBitCount[before & 0xff]} + kBitCount[before >> 8];
}

/// One level of a tree while it is coded. Indices count from kFirstNode.
struct Layer {
  std::vector<std::uint16_t> nodes;        ///< with the uniform ones in front
  std::vector<std::uint32_t> first_inner;  ///< index of a node's first inner child in the layer below
  std::vector<std::uint32_t>
      first_leaf;              ///< number of leaves before a node's first, among its layer's children
  std::vector<Beside> beside;  ///< from 0

  [[nodiscard]] std::size_t size() const { return beside.size(); }

  /// Forgets what was coded: `size()` nodes to come.
  void open() {
    nodes.assign(kFirstNode + size(), kNotYet);
    for (std::uint32_t i = 0; i < kFirstNode; ++i) nodes[i] = kUniform[i];
    first_inner.assign(nodes.size(), kFirstNode);
    first_leaf.assign(nodes.size(), 0);
  }

  /// After all nodes are coded.
  void count_children() {
    std::uint32_t inner = kFirstNode, leaf = 0;
    for (std::size_t i = kFirstNode; i < nodes.size(); ++i) {
      first_inner[i] = inner;
      first_leaf[i] = leaf;
      const std::uint32_t node = nodes[i];
      inner += rank_of(node & (node >> 1) & 0x5555u, 8);
      leaf += rank_of((node ^ (node >> 1)) & 0x5555u, 8);
    }
    inner_children = inner - kFirstNode;
    leaf_children = leaf;
  }
  std::size_t inner_children = 0, leaf_children = 0;

  void make_root() { beside.assign(1, {}); }

  /// The inner children of `parent`, which is coded and counted.
  void make_children(const Layer& parent) {
    beside.clear();
    beside.reserve(parent.inner_children);
    for (std::size_t i = 0; i < parent.size(); ++i) {
      const auto own = static_cast<std::uint32_t>(i) + kFirstNode;
      std::uint32_t left = parent.nodes[own] & (parent.nodes[own] >> 1) & 0x5555u;
      for (; left != 0; left &= left - 1) {
        const auto child = static_cast<unsigned>(std::countr_zero(left)) / 2;
        Beside b;
        for (std::size_t o = 0; o < kBeside; ++o) {
          const Origin& origin = kOrigins[child][o];
          b.index[o] =
              parent.look(origin.slot == kSelf ? own : parent.beside[i].index[origin.slot], origin.child);
        }
        beside.push_back(b);
      }
    }
  }

 private:
  /// Index, in the layer below, of a child of the node at `index`.
  [[nodiscard]] std::uint32_t look(std::uint32_t index, unsigned child) const {
    const std::uint32_t node = nodes[index];
    const std::uint32_t cell = node >> (2 * child) & 3;
    if (cell != 3) return cell;
    return first_inner[index] + rank_of(node & (node >> 1) & 0x5555u, child);
  }
};

/// For each child (two bits at 2 c) the cell beyond its node's border along an axis, or along two.
struct Outside {
  std::uint32_t x, y, z, xy, xz, yz;
};
/// @param i  node of the layer, from 0.
[[nodiscard]] inline Outside look_around(const Layer& layer, std::size_t i) {
  std::array<std::uint32_t, kBeside> w{};
  for (std::size_t k = 0; k < kBeside; ++k) w[k] = layer.nodes[layer.beside[i].index[k]];
  Outside o{};
  o.x = (w[0] >> 2 & 0x3333) | (w[1] << 2 & 0xCCCC);
  o.y = (w[2] >> 4 & 0x0F0F) | (w[3] << 4 & 0xF0F0);
  o.z = (w[4] >> 8 & 0x00FF) | (w[5] << 8 & 0xFF00);
  o.xy = (w[6] >> 6 & 0x0303) | (w[7] >> 2 & 0x0C0C) | (w[8] << 2 & 0x3030) | (w[9] << 6 & 0xC0C0);
  o.xz = (w[10] >> 10 & 0x0033) | (w[11] >> 6 & 0x00CC) | (w[12] << 6 & 0x3300) | (w[13] << 10 & 0xCC00);
  o.yz = (w[14] >> 12 & 0x000F) | (w[15] >> 4 & 0x00F0) | (w[16] << 4 & 0x0F00) | (w[17] << 12 & 0xF000);
  return o;
}

}  // namespace mapcodec::occupancy
