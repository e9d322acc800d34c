// SPDX-License-Identifier: GPL-3.0-or-later
// The order in which a tree is coded, for both directions (FORMAT.md 12): level by level from the root, in
// each the structure, then the leaves' log-odds and colours; last, inner nodes that are not what their
// children say.
#pragma once

#include <optional>

#include "mapcodec/base/result.hpp"
#include "mapcodec/codec/occupancy_values.hpp"

namespace mapcodec::occupancy {

/// Values that occur, ascending, and whether others follow as 32 raw bits (symbol = size).
struct ValueTable {
  std::vector<std::uint32_t> values;  ///< float bits
  bool escapes = false;

  [[nodiscard]] std::uint32_t symbols() const {
    return static_cast<std::uint32_t>(values.size()) + (escapes ? 1 : 0);
  }
  /// Of bits that stand in the table, or the escape.
  [[nodiscard]] std::uint32_t symbol_of(std::uint32_t bits) const {
    const auto at =
        std::lower_bound(values.begin(), values.end(), bits,
                         [](std::uint32_t a, std::uint32_t b) { return to_ordered(a) < to_ordered(b); });
    const bool found = at != values.end() && *at == bits;
    return found ? static_cast<std::uint32_t>(at - values.begin())
                 : static_cast<std::uint32_t>(values.size());
  }
};

/// Numbers that both sides know before the first symbol.
struct StreamHead {
  std::uint64_t inner = 0, leaves = 0;
  bool exceptions = false;  ///< inner nodes may differ from what their children make of them
};

/// `Side::kDecodes` says whether `tree` is filled or read.
template <class Side>
class Stream {
 public:
  Stream(Side side, const StreamHead& head, const ValueTable& table)
      : side_(side), head_(head), table_(table), structure_(head.inner) {}

  Status run(OccupancyTree& tree) {
    const bool valued = tree.kind != OccupancyKind::binary;
    if (valued) {
      values_.emplace(std::max(table_.symbols(), 1u), head_.leaves);
      if (tree.kind == OccupancyKind::color) colors_.emplace(head_.leaves);
    }
    if (tree.root != Cell::inner) return valued ? code_root(tree) : Status{};
    Layer layer, below;
    layer.make_root();
    for (unsigned h = tree.height; h > 0 && layer.size() > 0; --h) {
      MAPCODEC_TRY(code_structure(tree.levels[h], layer, h));
      layer.count_children();
      MAPCODEC_TRY(check_counts(layer, h));
      if (valued) MAPCODEC_TRY(code_leaves(tree.levels[h - 1], layer, h, tree.kind));
      below.make_children(layer);
      std::swap(layer, below);
    }
    if (Side::kDecodes && (inner_ != head_.inner || leaves_ != head_.leaves))
      return make_error(ErrorCode::kMalformed, "octree has fewer nodes than its header says");
    return valued ? code_nodes(tree) : Status{};
  }

 private:
  static Error ended() { return make_error(ErrorCode::kTruncated, "occupancy code ends too early"); }

  Status code_structure(OccupancyLevel& level, Layer& layer, unsigned height) {
    layer.open();
    if constexpr (Side::kDecodes) level.nodes.resize(layer.size());
    for (std::size_t i = 0; i < layer.size(); ++i) {
      const std::uint16_t node = structure_.code(side_, layer, i, height, level.nodes[i]);
      if constexpr (Side::kDecodes) {
        level.nodes[i] = node;
        if (node == 0) return make_error(ErrorCode::kMalformed, "octree has an inner node without children");
        if (!side_.ok()) return ended();
      }
      layer.nodes[kFirstNode + i] = node;
    }
    return {};
  }

  /// Before anything is allocated for the children.
  Status check_counts(const Layer& layer, unsigned height) {
    inner_ += layer.size();
    leaves_ += layer.leaf_children;
    if constexpr (Side::kDecodes) {
      if (inner_ + layer.inner_children > head_.inner || leaves_ > head_.leaves)
        return make_error(ErrorCode::kMalformed, "octree has more nodes than its header says");
      if (height == 1 && layer.inner_children > 0)
        return make_error(ErrorCode::kMalformed, "octree has inner nodes below its voxels");
    }
    return {};
  }

  Status code_root(OccupancyTree& tree) {
    Layer layer;
    layer.make_root();
    layer.open();
    layer.nodes[kFirstNode] = static_cast<std::uint16_t>(tree.root);
    layer.count_children();
    return code_leaves(tree.levels[tree.height], layer, tree.height + 1u, tree.kind);
  }

  Status code_leaves(OccupancyLevel& level, const Layer& layer, unsigned height, OccupancyKind kind) {
    if constexpr (Side::kDecodes) {
      level.leaf_values.resize(layer.leaf_children);
      if (kind == OccupancyKind::color) level.leaf_colors.resize(layer.leaf_children);
    }
    symbols_.assign(layer.leaf_children, 0);
    std::uint32_t leaf = 0;
    for (std::uint32_t i = kFirstNode; i < layer.nodes.size(); ++i) {
      std::uint32_t left = leaf_bits(layer.nodes[i]);
      for (; left != 0; left &= left - 1, ++leaf) {
        const auto child = static_cast<unsigned>(std::countr_zero(left)) / 2;
        const std::uint32_t occupied = layer.nodes[i] >> (2 * child + 1) & 1;
        const LeafPlace at{layer, i, child, leaf, occupied, std::min(height - 1, 3u)};
        MAPCODEC_TRY(code_value(at, level.leaf_values[leaf]));
        if (kind == OccupancyKind::color &&
            !colors_->code(side_, at, level.leaf_colors, level.leaf_colors[leaf]))
          return make_error(ErrorCode::kMalformed, "octree has a colour out of range");
        if (Side::kDecodes && !side_.ok()) return ended();
      }
    }
    return {};
  }

  Status code_value(const LeafPlace& at, std::uint32_t& value) {
    const std::uint32_t known = Side::kDecodes ? 0 : table_.symbol_of(value);
    const std::uint32_t symbol = values_->code(side_, at, symbols_, known);
    symbols_[at.leaf] = symbol;
    const bool escaped = table_.escapes && symbol == table_.values.size();
    if (escaped) value = static_cast<std::uint32_t>(side_.raw(value, 32));
    if constexpr (Side::kDecodes) {
      if (symbol >= table_.symbols())
        return make_error(ErrorCode::kMalformed, "octree has an unknown log-odds");
      if (!escaped) value = table_.values[symbol];
      if ((cell_of_value(value) == Cell::occupied) != (at.occupied != 0))
        return make_error(ErrorCode::kMalformed, "octree has a log-odds that contradicts its cell");
    }
    return {};
  }

  Status code_nodes(OccupancyTree& tree) {
    if constexpr (Side::kDecodes) {
      for (OccupancyLevel& l : tree.levels) {
        l.node_values.resize(l.nodes.size());
        if (tree.kind == OccupancyKind::color) l.node_colors.resize(l.nodes.size());
      }
    } else if (!head_.exceptions) {
      return {};
    }
    summarise_nodes(tree, [&](unsigned h, std::size_t i, const NodeSummary& s) {
      OccupancyLevel& level = tree.levels[h];
      code_node(s.value(), level.node_values[i], 32, other_value_);
      if (tree.kind != OccupancyKind::color) return;
      std::uint32_t color = pack(level.node_colors[i]);
      code_node(pack(s.color()), color, 24, other_color_);
      level.node_colors[i] = {static_cast<std::uint8_t>(color), static_cast<std::uint8_t>(color >> 8),
                              static_cast<std::uint8_t>(color >> 16)};
    });
    return Side::kDecodes && !side_.ok() ? Status(ended()) : Status{};
  }

  static std::uint32_t pack(const OccupancyColor& c) {
    return c[0] | std::uint32_t{c[1]} << 8 | std::uint32_t{c[2]} << 16;
  }

  void code_node(std::uint32_t expected, std::uint32_t& value, int bits, BitModel& other) {
    bool differs = false;
    if (head_.exceptions) {
      differs = side_.bit(value != expected, other.probability());
      other.update(differs);
    }
    if (differs)
      value = static_cast<std::uint32_t>(side_.raw(value, bits));
    else
      value = expected;
  }

  Side side_;
  StreamHead head_;
  const ValueTable& table_;
  StructureModel structure_;
  std::optional<ValueModel> values_;
  std::optional<ColorModel> colors_;
  std::vector<std::uint32_t> symbols_;
  BitModel other_value_, other_color_;
  std::uint64_t inner_ = 0, leaves_ = 0;
};

}  // namespace mapcodec::occupancy
