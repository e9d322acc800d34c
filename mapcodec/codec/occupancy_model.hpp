// SPDX-License-Identifier: GPL-3.0-or-later
// The structure of binary trees, by mixed bits (FORMAT.md 12.2). One template for both directions, so that
// encoder and decoder cannot disagree. `Side` has
//   bool bit(bool known, std::uint32_t p1)      codes `known` and returns it, or ignores it and decodes
#pragma once

#include <algorithm>

#include "mapcodec/codec/occupancy_neighbors.hpp"
#include "mapcodec/entropy/logistic_mixer.hpp"

namespace mapcodec::occupancy {

/// Binary contexts by hash. Those of one symbol lie side by side, so that a symbol costs one look into
/// memory.
class HashedModels {
 public:
  explicit HashedModels(unsigned bits) : models_(std::size_t{1} << bits), shift_(32 - bits) {}
  /// A row of `size` (a power of two) models.
  [[nodiscard]] BitModel* row(std::uint32_t key, std::uint32_t size) {
    return &models_[(key * 0x2545F491u >> shift_) & ~(size - 1)];
  }

 private:
  std::vector<BitModel> models_;
  std::uint32_t shift_;
};

/// log2 of the number of models for a stream of so many symbols: more of them than symbols only cost time.
[[nodiscard]] constexpr unsigned table_bits(std::uint64_t symbols, unsigned most) {
  return std::clamp(static_cast<unsigned>(std::bit_width(symbols)), 8u, most);
}

/// Which children nodes have.
class StructureModel {
 public:
  explicit StructureModel(std::uint64_t inner_nodes)
      : siblings_(table_bits(2 * inner_nodes, kMostBits)),
        faces_(table_bits(2 * inner_nodes, kMostBits)),
        around_(table_bits(2 * inner_nodes, kMostBits)) {}

  /// Codes the eight cells of node `i` of `layer`, whose side is 2^height.
  template <class Side>
  std::uint16_t code(Side& shared, const Layer& layer, std::size_t i, unsigned height, std::uint32_t known) {
    Side side = shared;  // in registers
    const Outside out = look_around(layer, i);
    const std::uint32_t size = std::min(height, 4u) - 1;
    std::uint32_t node = 0;
    for (unsigned c = 0; c < 8; ++c) {
      const Keys keys = keys_of(out, node, c, size);
      const Rows rows{siblings_.row(keys.siblings, 4), faces_.row(keys.faces, 4),
                      around_.row(keys.around, 4)};
      LogisticMixer* const mixers = &mixers_[(size * 8 + c) * 3];
      node |= code_cell(side, rows, mixers, height, known >> (2 * c) & 3) << (2 * c);
    }
    shared = side;
    return static_cast<std::uint16_t>(node);
  }

 private:
  static constexpr unsigned kMostBits = 16;

  struct Keys {
    std::uint32_t siblings, faces, around;
  };
  struct Rows {
    BitModel *a, *b, *c;
  };

  // A sibling that is not coded yet looks like an inner node (3), as neighbours do.
  static Keys keys_of(const Outside& o, std::uint32_t node, unsigned c, std::uint32_t size) {
    const unsigned s = 2 * c, sx = 2 * (c ^ 1), sy = 2 * (c ^ 2), sz = 2 * (c ^ 4);
    const std::uint32_t faces = (o.x >> s & 3) | (o.y >> s & 3) << 2 | (o.z >> s & 3) << 4;
    const std::uint32_t own = ((c & 1) != 0 ? node >> sx & 3 : 3) | ((c & 2) != 0 ? node >> sy & 3 : 3) << 2 |
                              ((c & 4) != 0 ? node >> sz & 3 : 3) << 4;
    const std::uint32_t edges = (o.x >> sy & 3) | (o.x >> sz & 3) << 2 | (o.y >> sx & 3) << 4 |
                                (o.y >> sz & 3) << 6 | (o.z >> sx & 3) << 8 | (o.z >> sy & 3) << 10;
    const std::uint32_t corners = (o.xy >> s & 3) | (o.xz >> s & 3) << 2 | (o.yz >> s & 3) << 4;
    const std::uint32_t history = node | 1u << s;
    Keys k{};
    k.siblings = (history * 3 + size * 0x10001u) * 0x9E3779B1u ^ size * 0x7F4A7C15u;
    k.faces = (history << 6 | faces) * 0x85EBCA6Bu ^ size * 0xC2B2AE35u;
    k.around = ((faces | own << 6 | edges << 12 | corners << 24) * 0x9E3779B1u + corners * 0x27D4EB2Fu) ^
               size * 0x165667B1u;
    return k;
  }

  template <class Side>
  static std::uint32_t code_cell(Side& side, const Rows& r, LogisticMixer* mixers, unsigned height,
                                 std::uint32_t known) {
    if (height > 1 && code_mixed(side, known == 3, mixers[0], r.a[0], r.b[0], r.c[0])) return 3;
    if (code_mixed(side, known == 0, mixers[1], r.a[1], r.b[1], r.c[1])) return 0;
    return code_mixed(side, known == 2, mixers[2], r.a[2], r.b[2], r.c[2]) ? 2 : 1;
  }

  HashedModels siblings_, faces_, around_;
  std::array<LogisticMixer, 4 * 8 * 3> mixers_{};
};

}  // namespace mapcodec::occupancy
