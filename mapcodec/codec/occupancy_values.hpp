// SPDX-License-Identifier: GPL-3.0-or-later
// Log-odds and colours of leaves in the context of the leaves beside them (FORMAT.md 12.4, 12.5). One symbol
// of sixteen where mixed bits would take many: reading a tree must not take much longer than building its
// nodes. One template for both directions; `Side` has
//   std::uint32_t nibble(std::uint32_t known, NibbleModel&)   codes `known` and returns it, or decodes
//   std::uint32_t nibble(std::uint32_t known, NibbleModel&, NibbleModel&)   the same with two contexts
//   bool bit(bool known, BitModel&)
//   std::uint32_t raw(std::uint32_t known, int count)         at most 16
#pragma once

#include <cstdlib>

#include "mapcodec/cloud/occupancy_tree.hpp"
#include "mapcodec/codec/occupancy_neighbors.hpp"
#include "mapcodec/codec/occupancy_table.hpp"
#include "mapcodec/entropy/bit_model.hpp"
#include "mapcodec/entropy/nibble_model.hpp"

namespace mapcodec::occupancy {

/// Neighbours that may have been coded before a leaf, nearest first: slots of kOffsets. All others come later
/// in Morton order.
inline constexpr std::array<std::uint8_t, 12> kBefore{0, 2, 4, 6, 10, 14, 7, 11, 15, 8, 12, 16};

/// What was coded of one layer's leaves: a place for each child of each of its nodes, empty until then.
class LeafBoard {
 public:
  /// A leaf's rank within its class, at most kMostRank, and the class: 0 nothing, else 1 + rank + 16 *
  /// occupied.
  static constexpr std::uint32_t kMostRank = 15;

  void open(const Layer& layer, bool colored) {
    tags_.assign(8 * layer.nodes.size(), 0);
    if (colored) colors_.assign(8 * layer.nodes.size(), 0);
  }
  void set_tag(std::size_t place, std::uint32_t occupied, std::uint32_t rank) {
    tags_[place] = static_cast<std::uint8_t>(1 + std::min(rank, kMostRank) + 16 * occupied);
  }
  void set_color(std::size_t place, const OccupancyColor& c) {
    colors_[place] = kColored | c[0] | std::uint32_t{c[1]} << 8 | std::uint32_t{c[2]} << 16;
  }
  [[nodiscard]] std::uint32_t tag(std::size_t place) const { return tags_[place]; }
  /// 0: none, or not coded yet.
  [[nodiscard]] std::uint32_t color(std::size_t place) const { return colors_[place]; }

 private:
  static constexpr std::uint32_t kColored = 1u << 24;
  std::vector<std::uint8_t> tags_;
  std::vector<std::uint32_t> colors_;
};

/// A leaf while those of its layer are coded in order.
struct LeafPlace {
  const LeafBoard& board;
  /// Of the board: first places of the neighbours of the leaf's node, and its own.
  const std::array<std::uint32_t, kBeside + 1>& around;
  unsigned child;
  std::uint32_t occupied;  ///< 0, 1
  std::uint32_t size;      ///< 0: a voxel; 1: larger

  [[nodiscard]] std::uint32_t own() const { return around[kSelf] + child; }
  [[nodiscard]] std::uint32_t beside(std::size_t slot) const {
    const Origin& origin = kOrigins[child][slot];
    return around[origin.slot] + origin.child;
  }
};

/// Ranks of log-odds among those of their class.
class ValueModel {
 public:
  explicit ValueModel(const ValueTable& table) {
    for (std::uint32_t o = 0; o < 2; ++o) {
      const std::vector<std::uint64_t> weights = table.weights(o);
      size_[o] = static_cast<std::uint32_t>(weights.size());
      models_[o].assign(2 * 17 * 17, first_of(weights));
      tail_[o].resize(3 * 16);
    }
  }

  /// @return the rank, which of hostile bytes may be too large.
  template <class Side>
  std::uint32_t code(Side& side, const LeafPlace& at, std::uint32_t known) {
    const std::uint32_t o = at.occupied, n = size_[o];
    if (n < 2) return 0;
    NibbleModel& model = models_[o][at.size * 17 * 17 + context(at)];
    const std::uint32_t head = side.nibble(std::min(known, 15u), model);
    return head < 15 || n <= 16 ? head : 15 + code_tail(side, o, known - 15);
  }

 private:
  static NibbleModel first_of(const std::vector<std::uint64_t>& weights) {
    std::array<std::uint64_t, 16> shares{};
    for (std::size_t i = 0; i < weights.size(); ++i) shares[std::min<std::size_t>(i, 15)] += weights[i];
    return {shares, 2};
  }

  /// The two nearest leaves of the same class.
  static std::uint32_t context(const LeafPlace& at) {
    std::uint32_t found[2] = {0, 0}, count = 0;
    for (const std::uint8_t slot : kBefore) {
      const std::uint32_t rank = at.board.tag(at.beside(slot)) - 16 * at.occupied;
      if (rank - 1 > LeafBoard::kMostRank) continue;
      found[count++] = rank;
      if (count == 2) break;
    }
    return 17 * found[0] + found[1];
  }

  /// As many digits of four bits as the largest rank needs.
  template <class Side>
  std::uint32_t code_tail(Side& side, std::uint32_t o, std::uint32_t known) {
    std::uint32_t v = 0;
    for (int digit = (std::bit_width(size_[o] - 16) + 3) / 4; digit-- > 0;) {
      NibbleModel& model = tail_[o][16 * static_cast<std::size_t>(digit) + (v & 15)];
      v = 16 * v + side.nibble(known >> (4 * digit) & 15, model);
    }
    return v;
  }

  std::array<std::uint32_t, 2> size_{};
  std::array<std::vector<NibbleModel>, 2> models_, tail_;
};

/// Colours, exact: the mean of the coloured neighbours, then what green, red and blue differ from it.
class ColorModel {
 public:
  /// @return false: a decoder met a colour that cannot be.
  template <class Side>
  bool code(Side& side, const LeafPlace& at, std::uint32_t rank, OccupancyColor& color) {
    BitModel& has = has_color_[at.occupied][std::min(rank, 31u)][last_[at.occupied]];
    const bool colored = side.bit(mapcodec::has_color(color), has);
    last_[at.occupied] = colored ? 1 : 0;
    if (!colored) {
      color = kNoColor;
      return true;
    }
    const Guess g = guess(at);
    std::int32_t first = 0, second = 0;
    for (std::uint32_t q = 0; q < 3; ++q) {
      constexpr std::size_t kOrder[3] = {1, 0, 2};
      const std::size_t d = kOrder[q];
      const std::int32_t shift = q == 0 ? 0 : (q == 1 ? first : (first + second) / 2);
      const std::int32_t p = std::clamp(g.color[d] + shift, 0, 255);
      NibbleModel& model = q == 0   ? green_[class_of(g.spread)][std::min(g.neighbors, 7u)]
                           : q == 1 ? red_[length(first)]
                                    : blue_[length(first)][length(second)];
      const std::int32_t v = p + code_difference(side, model, color[d] - p);
      if (v < 0 || v > 255) return false;
      color[d] = static_cast<std::uint8_t>(v);
      (q == 0 ? first : second) = v - g.color[d];
    }
    return true;
  }

 private:
  struct Guess {
    std::array<std::int32_t, 3> color{128, 128, 128};
    std::uint32_t spread = 40, neighbors = 0;  ///< mean distance of the neighbours' green to its guess
  };

  static std::uint32_t length(std::int32_t v) {
    return static_cast<std::uint32_t>(std::bit_width(static_cast<std::uint32_t>(std::abs(v))));
  }
  static std::uint32_t class_of(std::uint32_t spread) {
    return spread <= 8 ? spread : (spread < 16 ? 9 : (spread < 32 ? 10 : 11));
  }

  static Guess guess(const LeafPlace& at) {
    Guess g;
    std::array<std::int32_t, kBefore.size()> green;
    std::uint32_t weights = 0;
    std::array<std::uint32_t, 3> sum{};
    for (const std::uint8_t slot : kBefore) {
      const std::uint32_t c = at.board.color(at.beside(slot));
      if (c == 0) continue;
      const std::uint32_t w = slot < 6 ? 8 : 5;
      weights += w;
      for (unsigned d = 0; d < 3; ++d) sum[d] += w * (c >> (8 * d) & 255);
      green[g.neighbors++] = static_cast<std::int32_t>(c >> 8 & 255);
    }
    if (g.neighbors == 0) return g;
    for (std::size_t d = 0; d < 3; ++d)
      g.color[d] = static_cast<std::int32_t>((2 * sum[d] + weights) / (2 * weights));
    std::uint32_t spread = 0;
    for (std::size_t i = 0; i < g.neighbors; ++i)
      spread += static_cast<std::uint32_t>(std::abs(green[i] - g.color[1]));
    g.spread = spread / g.neighbors;
    return g;
  }

  /// Magnitudes below 4, then two classes for each bit length; what is left of them, and the sign, raw.
  template <class Side>
  std::int32_t code_difference(Side& side, NibbleModel& model, std::int32_t known) {
    const auto size = static_cast<std::uint32_t>(std::abs(known));
    const std::uint32_t bits = length(known);
    const std::uint32_t kind = size < 4 ? size : 2 * bits - 2 + (size >> (bits - 2) & 1);
    const std::uint32_t coded = side.nibble(kind, model);
    if (coded == 0) return 0;
    const std::uint32_t below = coded < 4 ? 0 : coded / 2 - 1;
    const std::uint32_t rest = side.raw(2 * (size & ((1u << below) - 1)) + (known < 0), int(below) + 1);
    const std::uint32_t base = coded < 4 ? coded : (2 + (coded & 1)) << below;
    const auto v = static_cast<std::int32_t>(base + (rest >> 1));
    return (rest & 1) != 0 ? -v : v;
  }

  std::array<std::array<std::array<BitModel, 2>, 32>, 2> has_color_{};
  std::array<std::uint8_t, 2> last_{};
  std::array<std::array<NibbleModel, 8>, 12> green_{};
  std::array<NibbleModel, 10> red_{};
  std::array<std::array<NibbleModel, 10>, 10> blue_{};
};

}  // namespace mapcodec::occupancy
