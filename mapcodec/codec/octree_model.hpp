// SPDX-License-Identifier: GPL-3.0-or-later
// The adaptive state of an octree stream and its contexts. One template for both directions, so that encoder
// and decoder cannot disagree. `Side` has
//   bool bit(bool known, BitModel&)                 codes `known` and returns it, or ignores it and decodes
//   bool bit(bool known, std::uint32_t p1)          the same with a given probability
//   std::uint64_t integer(std::uint64_t known, IntegerModel&)
#pragma once

#include <algorithm>

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
  Model(Side& side, const Mode& mode) : side_(side), mode_(mode), occupancy_(kHistories * kTouches) {
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
  std::uint32_t code_children(Level& level, std::uint32_t i, std::uint32_t mask, bool single) {
    Node& node = level.nodes[i];
    const Around around = look_around(level, node);
    if (mode_.singles && below_ >= 2 && !node.single) node.single = code_single_flag(node, around, single);
    if (node.single) {
      mask = code_single(around, mask);
    } else {
      mask = mode_.mixing ? code_mixed(node, around, mask) : code_plain(around, mask);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) slab_[axis][node.at[axis]] = kHalves[axis][mask];
    return mask;
  }

  /// Codes the count (>= 1) of leaf `i`; `counts` holds those of the leaves before it, index 0 is nobody's 0.
  std::uint64_t code_count(const Node& leaf, const std::vector<std::uint32_t>& counts, std::uint32_t i,
                           std::uint64_t known) {
    const CountContext context = count_context(leaf, counts, i);
    if (context.large) return 1 + side_.integer(known - 1, count_integer_[context.level]);
    BitModel* more = &count_more_[(context.level * 7 + context.faces) * kCountUnary];
    for (std::uint32_t v = 1; v <= kCountUnary; ++v) {
      if (!side_.bit(known > v, more[v - 1])) return v;
    }
    return kCountUnary + 1 + side_.integer(known - kCountUnary - 1, count_rest_);
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

  bool code_single_flag(const Node& node, const Around& around, bool known) {
    const std::uint32_t context = (std::min(below_, 8u) - 1) * 63 + around.faces * 9 + node.siblings;
    return side_.bit(known, single_flag_[context]);
  }

  // One bit for each of z, y, x: which half holds the voxel.
  std::uint32_t code_single(const Around& around, std::uint32_t known) {
    std::uint32_t child = 0;
    for (std::uint32_t axis = 3; axis-- > 0;) {
      const std::uint32_t other = axis == 0 ? 1 : 0;
      const std::uint32_t third = axis == 2 ? 1 : 2;
      const std::uint32_t touching =
          around.before[axis] == 0 ? 0 : 1 + (kHalves[axis][around.before[axis]] >> 1);
      std::uint32_t context = (axis * 4 + around.slab[axis]) * 3 + touching;
      context = context * 2 + around.after[axis];
      context = context * 4 + kHalves[axis][around.before[other]];
      context = context * 4 + kHalves[axis][around.before[third]];
      const bool high = side_.bit((known & kHalfMask[axis][1]) != 0, single_bit_[context]);
      child |= std::uint32_t{high} << axis;
    }
    return 1u << child;
  }

  static std::uint64_t touches(const Around& a) {
    return kTouch[0][a.after[0]][a.before[0]] + kTouch[1][a.after[1]][a.before[1]] +
           kTouch[2][a.after[2]][a.before[2]];
  }

  // `history` is a 1 followed by the bits coded so far. Seven zeros make the eighth bit a 1.
  std::uint32_t code_plain(const Around& around, std::uint32_t known) {
    std::uint64_t touch = touches(around);
    std::uint32_t history = 1;
    std::uint32_t mask = 0;
    for (std::uint32_t i = 0; i < 7; ++i, touch >>= 8) {
      const bool bit = side_.bit((known >> i & 1) != 0, occupancy_[history * kTouches + (touch & 0xff)]);
      history = 2 * history + bit;
      mask |= std::uint32_t{bit} << i;
    }
    if (mask == 0) return 128;
    return mask | std::uint32_t{side_.bit((known >> 7) != 0, occupancy_[history * kTouches + touch])} << 7;
  }

  std::uint32_t code_mixed(const Node& node, const Around& around, std::uint32_t known) {
    std::uint64_t touch = touches(around);
    std::uint64_t slab = kSlabWord[around.slab[0] | around.slab[1] << 2 | around.slab[2] << 4];
    const std::uint32_t size = (node.siblings == 0 ? 0u : node.siblings - 1u) * 8 + std::min(below_, 8u) - 1;
    std::uint32_t history = 1;
    std::uint32_t mask = 0;
    for (std::uint32_t i = 0; i < 8; ++i, touch >>= 8, slab >>= 8) {
      if (history == 128) return 128;
      BitModel& a = occupancy_[history * kTouches + (touch & 0xff)];
      BitModel& b = by_slab_[history * 8 + (slab & 7)];
      BitModel& c = by_size_[history * 64 + size];
      const bool bit = code_from_three((known >> i & 1) != 0, a, b, c, mixers_[i]);
      history = 2 * history + bit;
      mask |= std::uint32_t{bit} << i;
    }
    return mask;
  }

  bool code_from_three(bool known, BitModel& a, BitModel& b, BitModel& c, LogisticMixer& mixer) {
    const LogisticMixer::Mixed mixed = mixer.predict(a, b, c);
    const bool bit = side_.bit(known, mixed.probability);
    mixer.update(mixed, bit);
    a.update(bit);
    b.update(bit);
    c.update(bit);
    return bit;
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
    const std::uint32_t quarters[] = {4, 5, 6, 8, 12, 20};
    std::uint32_t level = 0;
    while (level < 6 && 4 * sum > quarters[level] * terms) ++level;
    return {level, faces, false};
  }

  static constexpr std::uint32_t kCountIntegers = 8;

  Side& side_;
  Mode mode_;
  std::uint32_t below_ = 0;
  std::array<std::vector<std::uint8_t>, 3> slab_;
  std::vector<BitModel> occupancy_, by_slab_, by_size_, single_flag_, single_bit_, count_more_;
  std::array<LogisticMixer, 8> mixers_{};
  std::array<IntegerModel, kCountIntegers> count_integer_{};
  IntegerModel count_rest_{};
};

}  // namespace mapcodec::octree
