// SPDX-License-Identifier: GPL-3.0-or-later
// The adaptive state of an octree stream and its contexts. One template for both directions, so that encoder
// and decoder cannot disagree. `Side` has
//   bool bit(bool known, BitModel&)                 codes `known` and returns it, or ignores it and decodes
//   bool bit(bool known, std::uint32_t p1)          the same with a given probability
//   std::uint32_t mask(bool known, std::uint32_t p1)  the same as a mask, all ones or zero
//   std::uint64_t integer(std::uint64_t known, IntegerModel&)
#pragma once

#include <algorithm>
#include <vector>

#include "mapcodec/codec/octree_tables.hpp"
#include "mapcodec/entropy/integer_model.hpp"
#include "mapcodec/entropy/logistic_mixer.hpp"

namespace mapcodec::octree {

/// First byte of an octree stream.
struct Mode {
  bool mixing = false;    ///< bit 0: three mixed contexts instead of one
  bool counts = false;    ///< bit 1: counts follow the geometry; else all are 1
  bool singles = false;   ///< bit 2: cells that hold one voxel are flagged
  std::uint8_t tail = 0;  ///< bits 3..7: lowest levels that are stored raw, point by point

  [[nodiscard]] std::uint8_t byte() const {
    return static_cast<std::uint8_t>(mixing | counts << 1 | singles << 2 | tail << 3);
  }
  [[nodiscard]] static Mode from(std::uint8_t b) {
    return {(b & 1) != 0, (b & 2) != 0, (b & 4) != 0, static_cast<std::uint8_t>(b >> 3)};
  }
};

template <class Side>
class Model {
 public:
  explicit Model(const Mode& mode) : mode_(mode), occupancy_(kHistories * kTouches) {
    if (mode.mixing) {
      by_slab_.resize(kHistories * 8);
      by_size_.resize(kHistories * 64);
    }
    if (mode.singles) {
      single_flag_.resize(8 * 7 * 9);
      single_bit_.resize(3 * 4 * 3 * 2 * 16);
    }
    if (mode.counts) count_more_.resize(kCountClasses * 7 * kCountUnary);
  }

  /// Starts a level whose cells have coordinates below 2^bits and `below` levels beneath them.
  void start_level(std::uint32_t bits, std::uint32_t below) {
    below_ = below;
    for (auto& s : slab_) s.assign(std::size_t{1} << bits, 0);
  }

  /// Codes which children node `i` has (never none) and, once, whether it holds a single voxel.
  /// @param mask, single  the truth; ignored by a decoder.
  std::uint32_t code_children(Side& side, Level& level, std::uint32_t i, std::uint32_t mask, bool single) {
    Node& node = level.nodes[i];
    const Around around = look_around(level, node);
    if (mode_.singles && below_ >= 2 && !node.single)
      node.single = code_single_flag(side, node, around, single);
    if (node.single) {
      mask = code_single(side, around, mask);
    } else {
      mask = mode_.mixing ? code_children_mixed(side, node, around, mask)
                          : code_children_plain(side, around, mask);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) slab_[axis][node.at[axis]] = kHalves[axis][mask];
    return mask;
  }

  /// Codes the count (>= 1) of leaf `i`; `counts` holds those of the leaves before it, index 0 is nobody's 0.
  std::uint64_t code_count(Side& side, const Node& leaf, const std::vector<std::uint32_t>& counts,
                           std::uint32_t i, std::uint64_t known) {
    const CountContext context = count_context(leaf, counts, i);
    if (context.large) return 1 + side.integer(known - 1, count_integer_[context.level]);
    BitModel* more = &count_more_[(context.level * 7 + context.faces) * kCountUnary];
    for (std::uint32_t v = 1; v <= kCountUnary; ++v) {
      if (!side.bit(known > v, more[v - 1])) return v;
    }
    return kCountUnary + 1 + side.integer(known - kCountUnary - 1, count_rest_);
  }

 private:
  static constexpr std::uint32_t kHistories = 256;
  static constexpr std::uint32_t kTouches = 27;
  static constexpr std::uint32_t kCountClasses = 8;
  static constexpr std::uint32_t kCountUnary = 16;

  /// What is known around a node before it is coded.
  struct Around {
    std::array<std::uint32_t, 3> before;  ///< masks of the coded neighbours at -x, -y, -z; 0: none
    std::array<std::uint32_t, 3> after;   ///< 1: there is a node at +x, +y, +z
    std::array<std::uint32_t, 3> slab;    ///< halves of the last node in the same slab of each axis
    std::uint32_t faces;                  ///< neighbours present, 0..6
  };

  Around look_around(const Level& level, const Node& node) const {
    Around a{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      a.before[axis] = level.links[node.beside[2 * axis]].mask;
      a.after[axis] = node.beside[2 * axis + 1] != 0;
      a.slab[axis] = slab_[axis][node.at[axis]];
      a.faces += (a.before[axis] != 0) + a.after[axis];
    }
    return a;
  }

  bool code_single_flag(Side& side, const Node& node, const Around& around, bool known) {
    const std::uint32_t context = (std::min(below_, 8u) - 1) * 63 + around.faces * 9 + node.siblings;
    return side.bit(known, single_flag_[context]);
  }

  // One bit for each of z, y, x: which half holds the voxel.
  std::uint32_t code_single(Side& shared, const Around& around, std::uint32_t known) {
    Side side = shared;
    std::uint32_t mask = 0xff;
    mask &= kHalfMask[2][0] ^ code_half<2>(side, around, known);
    mask &= kHalfMask[1][0] ^ code_half<1>(side, around, known);
    mask &= kHalfMask[0][0] ^ code_half<0>(side, around, known);
    shared = side;
    return mask;
  }

  /// All ones for the high half, zero for the low one.
  template <std::uint32_t axis>
  std::uint32_t code_half(Side& side, const Around& around, std::uint32_t known) {
    constexpr std::uint32_t kOther = axis == 0 ? 1 : 0;
    constexpr std::uint32_t kThird = axis == 2 ? 1 : 2;
    std::uint32_t context = (axis * 4 + around.slab[axis]) * 6;
    context += kSingleTouch[axis][around.before[axis]] + around.after[axis];
    context = context * 4 + kHalves[axis][around.before[kOther]];
    context = context * 4 + kHalves[axis][around.before[kThird]];
    BitModel& model = single_bit_[context];
    const std::uint32_t one = side.mask((known & kHalfMask[axis][1]) != 0, model.probability());
    model.learn(one);
    return one;
  }

  static std::uint64_t touches(const Around& a) {
    return kTouch[0][a.after[0]][a.before[0]] + kTouch[1][a.after[1]][a.before[1]] +
           kTouch[2][a.after[2]][a.before[2]];
  }

  // `history` is a 1 followed by the bits coded so far. Seven zeros make the eighth bit a 1. The contexts of
  // both values of a bit are fetched before it is known: a decoder then waits for its arithmetic alone, which
  // a local copy of the side keeps in registers.
  std::uint32_t code_children_plain(Side& shared, const Around& around, std::uint32_t known) {
    Side side = shared;
    std::uint64_t touch = touches(around);
    BitModel* model = &occupancy_[(touch & 0xff) * kHistories + 1];
    std::uint32_t p1 = model->probability();
    std::uint32_t history = 1;
    std::uint32_t mask = 0;
#pragma GCC unroll 7
    for (std::uint32_t i = 0; i < 7; ++i) {
      touch >>= 8;
      BitModel* const next = &occupancy_[(touch & 0xff) * kHistories + 2 * history];
      const std::uint32_t after_zero = next[0].probability(), after_one = next[1].probability();
      const std::uint32_t one = side.mask((known >> i & 1) != 0, p1);
      model->learn(one);
      p1 = after_zero ^ ((after_zero ^ after_one) & one);
      model = next + (one & 1);
      history = 2 * history + (one & 1);
      mask |= one & 1u << i;
    }
    if (mask == 0) {
      mask = 128;
    } else {
      const std::uint32_t one = side.mask((known >> 7) != 0, p1);
      model->learn(one);
      mask |= one & 128;
    }
    shared = side;
    return mask;
  }

  std::uint32_t code_children_mixed(Side& side, const Node& node, const Around& around, std::uint32_t known) {
    std::uint64_t touch = touches(around);
    std::uint64_t slab = kSlabWord[around.slab[0] | around.slab[1] << 2 | around.slab[2] << 4];
    const std::uint32_t size = (node.siblings == 0 ? 0u : node.siblings - 1u) * 8 + std::min(below_, 8u) - 1;
    std::uint32_t history = 1;
    std::uint32_t mask = 0;
    for (std::uint32_t i = 0; i < 8; ++i, touch >>= 8, slab >>= 8) {
      if (history == 128) return 128;
      BitModel& a = occupancy_[(touch & 0xff) * kHistories + history];
      BitModel& b = by_slab_[history * 8 + (slab & 7)];
      BitModel& c = by_size_[history * 64 + size];
      const bool bit = code_mixed(side, (known >> i & 1) != 0, mixers_[i], a, b, c);
      history = 2 * history + bit;
      mask |= std::uint32_t{bit} << i;
    }
    return mask;
  }

  struct CountContext {
    std::uint32_t level;  ///< class of the mean count around
    std::uint32_t faces;
    bool large;
  };
  // Mean count of the coded face neighbours and of the leaf before, in classes; large means get an integer
  // code.
  CountContext count_context(const Node& leaf, const std::vector<std::uint32_t>& counts,
                             std::uint32_t i) const {
    std::uint64_t sum = i > 1 ? counts[i - 1] : 1;
    std::uint32_t terms = 1;
    std::uint32_t faces = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t n = counts[leaf.beside[2 * axis]];
      sum += n;
      terms += n != 0;
      faces += (n != 0) + (leaf.beside[2 * axis + 1] != 0);
    }
    if (sum > 8 * terms) {
      const auto level = static_cast<std::uint32_t>(std::bit_width(sum / terms));  // >= 4
      return {std::min(level, kCountIntegers + 3) - 4, faces, true};
    }
    return {kCountClass[terms][sum], faces, false};
  }

  static constexpr std::uint32_t kCountIntegers = 8;

  Mode mode_;
  std::uint32_t below_ = 0;
  std::array<std::vector<std::uint8_t>, 3> slab_;
  std::vector<BitModel> occupancy_, by_slab_, by_size_, single_flag_, single_bit_, count_more_;
  std::array<LogisticMixer, 8> mixers_{};
  std::array<IntegerModel, kCountIntegers> count_integer_{};
  IntegerModel count_rest_{};
};

}  // namespace mapcodec::octree
