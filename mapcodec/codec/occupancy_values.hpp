// SPDX-License-Identifier: GPL-3.0-or-later
// Log-odds and colours of leaves in the context of the leaves beside them (FORMAT.md 12).
#pragma once

#include <cstdlib>

#include "mapcodec/cloud/occupancy_tree.hpp"
#include "mapcodec/codec/occupancy_model.hpp"

namespace mapcodec::occupancy {

[[nodiscard]] constexpr std::uint32_t join_keys(std::uint32_t a, std::uint32_t b) {
  return (a * 0x85EBCA6Bu ^ b) * 0xC2B2AE35u + 0x27D4EB2Fu;
}

/// Float bits to integers that ascend with the value, and back.
[[nodiscard]] constexpr std::uint32_t to_ordered(std::uint32_t bits) {
  return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}
[[nodiscard]] constexpr std::uint32_t from_ordered(std::uint32_t v) {
  return (v & 0x80000000u) != 0 ? v & 0x7fffffffu : ~v;
}

/// The leaf child `child` of node `index` while its layer's leaves are coded in order.
struct LeafPlace {
  const Layer& layer;
  std::uint32_t node;  ///< index, from kFirstNode
  unsigned child;
  std::uint32_t leaf;      ///< number among the layer's leaves
  std::uint32_t occupied;  ///< 0, 1
  std::uint32_t size;      ///< 0: a voxel; 1, 2, 3: larger

  static constexpr std::uint32_t kNobody = 0xffffffffu;
  struct Neighbor {
    std::uint32_t cell;  ///< 0 .. 3
    std::uint32_t leaf;  ///< its number if it was coded before this one, else kNobody
  };
  [[nodiscard]] Neighbor beside(std::size_t slot) const {
    const Origin& origin = kOrigins[child][slot];
    const std::uint32_t index =
        origin.slot == kSelf ? node : layer.beside[node - kFirstNode].index[origin.slot];
    const std::uint32_t word = layer.nodes[index];
    const std::uint32_t cell = word >> (2 * origin.child) & 3;
    if (index < kFirstNode || cell == 0 || cell == 3) return {cell, kNobody};
    const std::uint32_t k = layer.first_leaf[index] + rank_of((word ^ (word >> 1)) & 0x5555u, origin.child);
    return {cell, k < leaf ? k : kNobody};
  }
};

/// Numbers of values in a table of those that occur.
class ValueModel {
 public:
  /// @param symbols  how many there are, at least 1.  @param leaves  how many will be coded.
  ValueModel(std::uint32_t symbols, std::uint64_t leaves)
      : bits_(static_cast<unsigned>(std::bit_width(symbols - 1))),
        models_{HashedModels(table_bits(2 * leaves, kMostBits)),
                HashedModels(table_bits(2 * leaves, kMostBits)),
                HashedModels(table_bits(2 * leaves, kMostBits))} {}

  /// @param coded  symbols of the layer's leaves before this one.
  template <class Side>
  std::uint32_t code(Side& side, const LeafPlace& at, const std::vector<std::uint32_t>& coded,
                     std::uint32_t known) {
    const Keys k = keys_of(at, coded);
    std::uint32_t node = 1;
    for (unsigned i = bits_; i-- > 0;) {
      const std::uint32_t base = join_keys(node * 2 + at.occupied, at.size);
      LogisticMixer& mixer = mixers_[std::min(node, 31u) * 4 + at.occupied * 2 + (at.size != 0)];
      const bool bit = code_mixed(side, (known >> i & 1) != 0, *models_[0].row(join_keys(base, k.faces), 1),
                                  *models_[1].row(join_keys(base, k.counts), 1),
                                  *models_[2].row(join_keys(base, k.edges), 1), mixer);
      node = 2 * node + bit;
    }
    last_ = node - (1u << bits_);
    return last_;
  }

 private:
  static constexpr unsigned kMostBits = 18;
  struct Keys {
    std::uint32_t faces, counts, edges;
  };

  Keys keys_of(const LeafPlace& at, const std::vector<std::uint32_t>& coded) const {
    std::array<std::uint32_t, kBeside> seen{};  // 0 .. 2: a cell without a symbol; else 3 + symbol
    std::array<std::uint32_t, 4> faces{};
    std::uint32_t sum = 0, known = 0;
    for (std::size_t o = 0; o < kBeside; ++o) {
      const LeafPlace::Neighbor n = at.beside(o);
      const bool has = n.leaf != LeafPlace::kNobody;
      seen[o] = has ? 3 + coded[n.leaf] : n.cell % 3;
      sum += has ? coded[n.leaf] : 0;
      known += has;
      if (o < 6) ++faces[n.cell];
    }
    const std::uint32_t mean = known == 0 ? 0 : (2 * sum + known) / (2 * known) + 1;
    Keys k{};
    k.faces = join_keys(join_keys(seen[0], seen[2]), seen[4]);
    k.counts = join_keys(faces[1] * 8 + faces[2], last_ * 2 + 1);
    k.edges = join_keys(join_keys(seen[6], seen[10]), join_keys(seen[14], mean));
    return k;
  }

  unsigned bits_;
  std::uint32_t last_ = 0;
  std::array<HashedModels, 3> models_;
  std::array<LogisticMixer, 32 * 4> mixers_{};
};

/// Colours, exact: the mean of the coloured neighbours, then what green, red and blue differ from it.
class ColorModel {
 public:
  explicit ColorModel(std::uint64_t leaves)
      : models_{HashedModels(table_bits(2 * leaves, kMostBits)),
                HashedModels(table_bits(2 * leaves, kMostBits)),
                HashedModels(table_bits(2 * leaves, kMostBits))} {}

  /// @param coded  colours of the layer's leaves before this one.
  /// @return false: a decoder met a colour that cannot be.
  template <class Side>
  bool code(Side& side, const LeafPlace& at, const std::vector<OccupancyColor>& coded,
            OccupancyColor& color) {
    const Guess g = guess(at, coded);
    BitModel& has = has_color_[at.occupied * 3 + std::min(g.neighbors, 2u)];
    const bool colored = side.bit(color != kNoColor, has.probability());
    has.update(colored);
    if (!colored) {
      color = kNoColor;
      return true;
    }
    std::int32_t first = 0, second = 0;
    for (std::uint32_t q = 0; q < 3; ++q) {
      constexpr std::size_t kOrder[3] = {1, 0, 2};
      const std::size_t d = kOrder[q];
      const std::int32_t shift = q == 0 ? 0 : (q == 1 ? first : (first + second) / 2);
      const std::int32_t p = std::clamp(g.color[d] + shift, 0, 255);
      const Situation s{q,
                        class_of(g.spread[d]),
                        std::min(g.neighbors, 7u),
                        length(first),
                        length(second),
                        std::min(g.spread[0] + g.spread[1] + g.spread[2], 127u) / 2};
      const std::int32_t v = p + code_difference(side, s, color[d] - p);
      if (v < 0 || v > 255) return false;
      color[d] = static_cast<std::uint8_t>(v);
      (q == 0 ? first : second) = v - g.color[d];
    }
    return true;
  }

 private:
  static constexpr unsigned kMostBits = 16;

  struct Guess {
    std::array<std::int32_t, 3> color{128, 128, 128};
    std::array<std::uint32_t, 3> spread{40, 40, 40};
    std::uint32_t neighbors = 0;
  };
  struct Situation {
    std::uint32_t component, spread, neighbors, first, second, activity;
  };

  static std::uint32_t length(std::int32_t v) {
    return static_cast<std::uint32_t>(std::bit_width(static_cast<std::uint32_t>(std::abs(v))));
  }
  static std::uint32_t class_of(std::uint32_t spread) {
    return spread <= 8 ? spread : (spread < 16 ? 9 : (spread < 32 ? 10 : 11));
  }

  static Guess guess(const LeafPlace& at, const std::vector<OccupancyColor>& coded) {
    Guess g;
    std::array<const OccupancyColor*, kBeside> near{};
    std::int32_t weights = 0;
    std::array<std::int32_t, 3> sum{};
    for (std::size_t o = 0; o < kBeside; ++o) {
      const LeafPlace::Neighbor n = at.beside(o);
      if (n.leaf == LeafPlace::kNobody || coded[n.leaf] == kNoColor) continue;
      near[g.neighbors++] = &coded[n.leaf];
      const std::int32_t w = o < 6 ? 8 : 5;
      weights += w;
      for (std::size_t d = 0; d < 3; ++d) sum[d] += w * coded[n.leaf][d];
    }
    for (std::size_t d = 0; d < 3 && g.neighbors > 0; ++d) {
      g.color[d] = (2 * sum[d] + weights) / (2 * weights);
      std::uint32_t spread = 0;
      for (std::size_t i = 0; i < g.neighbors; ++i)
        spread += static_cast<std::uint32_t>(std::abs((*near[i])[d] - g.color[d]));
      g.spread[d] = spread / g.neighbors;
    }
    return g;
  }

  /// Bit length in unary, sign, then the bits below the leading one.
  template <class Side>
  std::int32_t code_difference(Side& side, const Situation& s, std::int32_t known) {
    const auto size = static_cast<std::uint32_t>(std::abs(known));
    const auto bits = static_cast<unsigned>(std::bit_width(size));
    unsigned n = 0;
    while (n < 8 && code_bit(side, s, n, bits > n)) ++n;
    if (n == 0) return 0;
    const bool negative = code_bit(side, s, 8 + n, known < 0);
    std::uint32_t v = 1;
    for (unsigned i = n - 1; i-- > 0;) v = 2 * v + code_bit(side, s, 256 * n + v + 256, (size >> i & 1) != 0);
    return negative ? -static_cast<std::int32_t>(v) : static_cast<std::int32_t>(v);
  }

  /// @param what  which decision: below 8 length, below 17 sign, then the bits.
  template <class Side>
  bool code_bit(Side& side, const Situation& s, std::uint32_t what, bool known) {
    const std::uint32_t base = what * 4 + s.component;
    BitModel& a = *models_[0].row(join_keys(base, s.spread * 8 + s.neighbors), 1);
    BitModel& b = *models_[1].row(join_keys(base, (s.spread * 16 + s.first) * 16 + s.second), 1);
    BitModel& c = *models_[2].row(join_keys(base, s.activity), 1);
    return code_mixed(side, known, a, b, c, mixers_[std::min(what, 17u) * 3 + s.component]);
  }

  std::array<HashedModels, 3> models_;
  std::array<BitModel, 6> has_color_{};
  std::array<LogisticMixer, 18 * 3> mixers_{};
};

}  // namespace mapcodec::occupancy
