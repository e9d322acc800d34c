// SPDX-License-Identifier: GPL-3.0-or-later
// What leaves and inner nodes hold, for both directions (FORMAT.md 12.4 to 12.6). `Side` as in
// occupancy_stream.hpp, and
//   std::uint32_t rank_of(std::uint32_t value)   of log-odds in the table; decoders: anything
#pragma once

#include "mapcodec/base/result.hpp"
#include "mapcodec/codec/occupancy_values.hpp"

namespace mapcodec::occupancy {

template <class Side>
class LeafStream {
 public:
  explicit LeafStream(const ValueTable& table) : table_(table), values_(table) {}

  /// The leaves of one level, whose parents `layer` holds.
  /// @return what a decoder found wrong, or null.
  const char* code(Side& shared, OccupancyLevel& level, const Layer& layer, unsigned height,
                   OccupancyKind kind) {
    const bool colored = kind == OccupancyKind::color;
    if constexpr (Side::kDecodes) {
      level.leaf_values.resize(layer.leaf_children);
      if (colored) level.leaf_colors.resize(layer.leaf_children);
    }
    board_.open(layer, colored);
    Side side = shared;  // in registers
    std::array<std::uint32_t, kBeside + 1> around{};
    std::uint32_t leaf = 0;
    for (std::uint32_t i = kFirstNode; i < layer.nodes.size(); ++i) {
      const std::uint32_t node = layer.nodes[i];
      std::uint32_t left = leaf_bits(node);
      if (left == 0) continue;
      for (std::size_t k = 0; k < kBeside; ++k) around[k] = 8 * layer.beside[i - kFirstNode].index[k];
      around[kSelf] = 8 * i;
      for (; left != 0; left &= left - 1, ++leaf) {
        const auto child = static_cast<unsigned>(std::countr_zero(left)) / 2;
        const LeafPlace at{board_, around, child, node >> (2 * child + 1) & 1, height > 1 ? 1u : 0u};
        std::uint32_t rank = 0;
        const char* wrong = code_value(side, at, level.leaf_values[leaf], rank);
        if (wrong == nullptr && colored) wrong = code_color(side, at, level.leaf_colors[leaf], rank);
        if (wrong != nullptr) return wrong;
      }
      if (Side::kDecodes && !side.ok()) break;
    }
    shared = side;
    return nullptr;
  }

  /// All inner nodes, whose children are coded.
  void code_nodes(Side& side, OccupancyTree& tree, bool exceptions) {
    if constexpr (Side::kDecodes) {
      for (OccupancyLevel& l : tree.levels) {
        l.node_values.resize(l.nodes.size());
        if (tree.kind == OccupancyKind::color) l.node_colors.resize(l.nodes.size());
      }
    } else if (!exceptions) {
      return;
    }
    summarise_nodes(tree, [&](unsigned h, std::size_t i, const NodeSummary& s) {
      OccupancyLevel& level = tree.levels[h];
      code_node(side, s.value(), level.node_values[i], exceptions ? &other_value_ : nullptr);
      if (tree.kind != OccupancyKind::color) return;
      std::uint32_t color = pack(level.node_colors[i]);
      code_node(side, pack(s.color()), color, exceptions ? &other_color_ : nullptr);
      level.node_colors[i] = {static_cast<std::uint8_t>(color), static_cast<std::uint8_t>(color >> 8),
                              static_cast<std::uint8_t>(color >> 16)};
    });
  }

 private:
  const char* code_value(Side& side, const LeafPlace& at, std::uint32_t& value, std::uint32_t& rank) {
    rank = values_.code(side, at, side.rank_of(value));
    if (Side::kDecodes && rank >= table_.ranks(at.occupied)) return "octree has an unknown log-odds";
    if (table_.is_escape(at.occupied, rank)) {
      value = code_word(side, value);
      if (Side::kDecodes && ValueTable::class_of(value) != at.occupied)
        return "octree has a log-odds that contradicts its cell";
    } else if constexpr (Side::kDecodes) {
      value = table_.value(at.occupied, rank);
    }
    board_.set_tag(at.own(), at.occupied, rank);
    return nullptr;
  }

  const char* code_color(Side& side, const LeafPlace& at, OccupancyColor& color, std::uint32_t rank) {
    if (!colors_.code(side, at, rank, color)) return "octree has a colour out of range";
    if (has_color(color)) board_.set_color(at.own(), color);
    return nullptr;
  }

  static std::uint32_t code_word(Side& side, std::uint32_t value) {
    const std::uint32_t high = side.raw(value >> 16, 16);
    return high << 16 | side.raw(value & 0xffff, 16);
  }

  static std::uint32_t pack(const OccupancyColor& c) {
    return c[0] | std::uint32_t{c[1]} << 8 | std::uint32_t{c[2]} << 16;
  }

  /// @param other  null: all are as expected.
  static void code_node(Side& side, std::uint32_t expected, std::uint32_t& value, BitModel* other) {
    if (other != nullptr && side.bit(value != expected, *other))
      value = code_word(side, value);
    else
      value = expected;
  }

  const ValueTable& table_;
  ValueModel values_;
  ColorModel colors_;
  LeafBoard board_;
  BitModel other_value_, other_color_;
};

}  // namespace mapcodec::occupancy
