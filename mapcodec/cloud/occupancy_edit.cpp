// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/cloud/occupancy_edit.hpp"

#include <bit>

namespace mapcodec {
namespace {

std::size_t count_below(std::uint32_t bits, unsigned child) {
  return static_cast<std::size_t>(std::popcount(bits & ((1u << (2 * child)) - 1)));
}

template <class T>
void append_range(std::vector<T>& to, const std::vector<T>& from, std::size_t begin, std::size_t count) {
  if (from.empty()) return;
  const auto first = from.begin() + static_cast<std::ptrdiff_t>(begin);
  to.insert(to.end(), first, first + static_cast<std::ptrdiff_t>(count));
}

bool is_leaf(Cell c) {
  return c == Cell::free || c == Cell::occupied;
}

/// A leaf with what it holds, wherever that came from.
struct Leaf {
  Cell cell = Cell::unknown;
  std::uint32_t value = 0;
  OccupancyColor color = kNoColor;
  bool operator==(const Leaf&) const = default;
};
Leaf leaf_of(const OccupancyIndex& index, const OccupancyCell& c) {
  return {c.cell, index.value(c), index.color(c)};
}

/// Appends depth first, level by level.
class Builder {
 public:
  Builder(OccupancyKind kind, std::uint8_t height) {
    tree_.kind = kind;
    tree_.height = height;
  }

  Cell leaf(unsigned height, const Leaf& leaf) {
    OccupancyLevel& l = tree_.levels[height];
    if (tree_.kind != OccupancyKind::binary) l.leaf_values.push_back(leaf.value);
    if (tree_.kind == OccupancyKind::color) l.leaf_colors.push_back(leaf.color);
    return leaf.cell;
  }

  /// @param make  makes child i and says what it is.
  template <class F>
  Cell inner(unsigned height, F&& make) {
    OccupancyLevel& own = tree_.levels[height];
    const OccupancyLevel& below = tree_.levels[height - 1];
    const std::size_t i = own.nodes.size();
    own.nodes.push_back(0);
    std::uint32_t node = 0;
    NodeSummary s;
    for (unsigned c = 0; c < 8; ++c) {
      const Cell cell = make(c);
      node |= static_cast<std::uint32_t>(cell) << (2 * c);
      if (cell == Cell::unknown || tree_.kind == OccupancyKind::binary) continue;
      const auto& colors = cell == Cell::inner ? below.node_colors : below.leaf_colors;
      s.add((cell == Cell::inner ? below.node_values : below.leaf_values).back(),
            colors.empty() ? kNoColor : colors.back());
    }
    if (node == 0) {
      own.nodes.pop_back();
      return Cell::unknown;
    }
    own.nodes[i] = static_cast<std::uint16_t>(node);
    if (tree_.kind != OccupancyKind::binary) own.node_values.push_back(s.value());
    if (tree_.kind == OccupancyKind::color) own.node_colors.push_back(s.color());
    return Cell::inner;
  }

  Cell copy(const OccupancyIndex& index, const OccupancyCell& cell) {
    if (cell.cell == Cell::unknown) return Cell::unknown;
    const OccupancyTree part = index.subtree(cell);
    for (unsigned h = 0; h <= part.height; ++h) {
      const OccupancyLevel& from = part.levels[h];
      OccupancyLevel& to = tree_.levels[h];
      append_range(to.nodes, from.nodes, 0, from.nodes.size());
      append_range(to.leaf_values, from.leaf_values, 0, from.leaf_values.size());
      append_range(to.node_values, from.node_values, 0, from.node_values.size());
      append_range(to.leaf_colors, from.leaf_colors, 0, from.leaf_colors.size());
      append_range(to.node_colors, from.node_colors, 0, from.node_colors.size());
    }
    return cell.cell;
  }

  OccupancyTree finish(Cell root) {
    tree_.root = root;
    return std::move(tree_);
  }

 private:
  OccupancyTree tree_;
};

class Overlay {
 public:
  Overlay(const OccupancyTree& base, const OccupancyTree& top)
      : base_(base), top_(top), out_(base.kind, base.height) {}

  OccupancyTree run() { return out_.finish(lay(base_.root(), {}, top_.root())); }

 private:
  /// @param within  a leaf of `base` that contains this cell, if `b` is not one of the tree's own.
  Cell lay(const OccupancyCell& b, const Leaf& within, const OccupancyCell& t) {
    if (is_leaf(t.cell)) return out_.leaf(t.height, leaf_of(top_, t));
    const Leaf leaf = is_leaf(b.cell) ? leaf_of(base_, b) : within;
    if (t.cell == Cell::unknown) return is_leaf(leaf.cell) ? out_.leaf(t.height, leaf) : out_.copy(base_, b);
    if (b.cell == Cell::unknown && leaf.cell == Cell::unknown) return out_.copy(top_, t);
    if (const auto same = all_equal(b, leaf, t)) return out_.leaf(t.height, *same);
    return out_.inner(t.height, [&](unsigned i) {
      const auto height = static_cast<std::uint8_t>(t.height - 1);
      const OccupancyCell below =
          b.cell == Cell::inner ? base_.child(b, i) : OccupancyCell{Cell::unknown, height, 0};
      return lay(below, leaf, top_.child(t, i));
    });
  }

  /// The leaf that eight equal children are together, if they come from both trees.
  std::optional<Leaf> all_equal(const OccupancyCell& b, const Leaf& leaf, const OccupancyCell& t) const {
    std::optional<Leaf> first;
    bool from_base = false;
    for (unsigned i = 0; i < 8; ++i) {
      const OccupancyCell top = top_.child(t, i);
      if (top.cell == Cell::inner) return std::nullopt;
      Leaf own = leaf;
      if (top.cell != Cell::unknown)
        own = leaf_of(top_, top);
      else if (b.cell == Cell::inner)
        own = base_leaf(base_.child(b, i));
      from_base |= top.cell == Cell::unknown;
      if (!is_leaf(own.cell) || (first && !(*first == own))) return std::nullopt;
      first = own;
    }
    return from_base ? first : std::nullopt;
  }
  [[nodiscard]] Leaf base_leaf(const OccupancyCell& c) const {
    return is_leaf(c.cell) ? leaf_of(base_, c) : Leaf{};
  }

  OccupancyIndex base_, top_;
  Builder out_;
};

}  // namespace

OccupancyIndex::OccupancyIndex(const OccupancyTree& tree) : tree_(&tree) {
  for (unsigned h = 1; h <= tree.height; ++h) {
    First next{0, 0};
    first_[h].reserve(tree.levels[h].nodes.size());
    for (const std::uint16_t node : tree.levels[h].nodes) {
      first_[h].push_back(next);
      next.inner += static_cast<std::uint32_t>(std::popcount(inner_bits(node)));
      next.leaf += static_cast<std::uint32_t>(std::popcount(leaf_bits(node)));
    }
  }
}

OccupancyCell OccupancyIndex::child(const OccupancyCell& parent, unsigned child) const {
  const std::uint32_t node = tree_->levels[parent.height].nodes[parent.index];
  const First& first = first_[parent.height][parent.index];
  OccupancyCell c{cell_of(node, child), static_cast<std::uint8_t>(parent.height - 1), 0};
  c.index = c.cell == Cell::inner ? first.inner + count_below(inner_bits(node), child)
                                  : first.leaf + count_below(leaf_bits(node), child);
  return c;
}

OccupancyCell OccupancyIndex::find(const CellCorner& voxel) const {
  OccupancyCell c = root();
  while (c.cell == Cell::inner) {
    const unsigned h = c.height - 1u;
    c = child(c, (voxel[0] >> h & 1) | (voxel[1] >> h & 1) << 1 | (voxel[2] >> h & 1) << 2);
  }
  return c;
}

OccupancyTree OccupancyIndex::subtree(const OccupancyCell& cell) const {
  OccupancyTree part;
  part.kind = tree_->kind;
  part.height = cell.height;
  part.root = cell.cell;
  std::size_t node = cell.index, leaf = cell.index;
  std::size_t nodes = cell.cell == Cell::inner ? 1 : 0, leaves = is_leaf(cell.cell) ? 1 : 0;
  for (unsigned h = cell.height;; --h) {
    const OccupancyLevel& from = tree_->levels[h];
    OccupancyLevel& to = part.levels[h];
    append_range(to.nodes, from.nodes, node, nodes);
    append_range(to.node_values, from.node_values, node, nodes);
    append_range(to.node_colors, from.node_colors, node, nodes);
    append_range(to.leaf_values, from.leaf_values, leaf, leaves);
    append_range(to.leaf_colors, from.leaf_colors, leaf, leaves);
    if (h == 0 || nodes == 0) break;
    const First first = first_[h][node];
    node = first.inner;
    leaf = first.leaf;
    nodes = leaves = 0;
    for (const std::uint16_t n : to.nodes) {
      nodes += static_cast<std::size_t>(std::popcount(inner_bits(n)));
      leaves += static_cast<std::size_t>(std::popcount(leaf_bits(n)));
    }
  }
  return part;
}

std::uint32_t OccupancyIndex::value(const OccupancyCell& leaf) const {
  const auto& values = tree_->levels[leaf.height].leaf_values;
  return values.empty() ? 0 : values[leaf.index];
}

OccupancyColor OccupancyIndex::color(const OccupancyCell& leaf) const {
  const auto& colors = tree_->levels[leaf.height].leaf_colors;
  return colors.empty() ? kNoColor : colors[leaf.index];
}

OccupancyTree overlay(const OccupancyTree& base, const OccupancyTree& top) {
  return Overlay(base, top).run();
}

OccupancyTree clip(const OccupancyTree& tree, const CellCorner& corner,
                   const std::function<bool(const CellCorner&, unsigned)>& keep) {
  const OccupancyIndex index(tree);
  Builder out(tree.kind, tree.height);
  const std::function<Cell(const OccupancyCell&, const CellCorner&)> take =
      [&](const OccupancyCell& c, const CellCorner& at) -> Cell {
    if (c.cell == Cell::unknown || !keep(at, c.height)) return Cell::unknown;
    if (c.cell != Cell::inner) return out.leaf(c.height, leaf_of(index, c));
    return out.inner(c.height,
                     [&](unsigned i) { return take(index.child(c, i), child_corner(at, i, c.height - 1u)); });
  };
  const Cell root = take(index.root(), corner);
  return out.finish(root);
}

OccupancyTree to_binary(const OccupancyTree& tree) {
  OccupancyTree r;
  r.height = tree.height;
  r.root = tree.root;
  for (std::size_t h = 0; h < tree.levels.size(); ++h) r.levels[h].nodes = tree.levels[h].nodes;
  return r;
}

}  // namespace mapcodec
