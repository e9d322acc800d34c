// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/cloud/occupancy_pieces.hpp"

#include <algorithm>
#include <bit>
#include <tuple>

namespace mapcodec {
namespace {

TileKey child_key(const TileKey& k, unsigned child) {
  return {static_cast<std::int32_t>(2 * k.x + static_cast<int>(child & 1)),
          static_cast<std::int32_t>(2 * k.y + static_cast<int>(child >> 1 & 1)),
          static_cast<std::int32_t>(2 * k.z + static_cast<int>(child >> 2)),
          static_cast<std::uint8_t>(k.level - 1)};
}

template <class T>
void append_range(std::vector<T>& to, const std::vector<T>& from, std::size_t begin, std::size_t count) {
  if (from.empty()) return;
  const auto first = from.begin() + static_cast<std::ptrdiff_t>(begin);
  to.insert(to.end(), first, first + static_cast<std::ptrdiff_t>(count));
}

/// How many inner nodes each subtree has, its root included.
using Sizes = std::array<std::vector<std::uint64_t>, kOccupancyHeight + 1>;

Sizes subtree_sizes(const OccupancyTree& tree) {
  Sizes sizes;
  for (unsigned h = 1; h <= tree.height; ++h) {
    std::size_t child = 0;
    for (const std::uint16_t node : tree.levels[h].nodes) {
      std::uint64_t n = 1;
      for (int k = std::popcount(inner_bits(node)); k > 0; --k) n += sizes[h - 1][child++];
      sizes[h].push_back(n);
    }
  }
  return sizes;
}

/// Walks depth first, so that what comes next in each level is known by counting.
class Cutter {
 public:
  Cutter(const OccupancyTree& tree, std::uint64_t most_nodes, std::uint8_t least_height,
         std::vector<OccupancyExtra>& extras)
      : tree_(tree),
        most_(most_nodes),
        least_height_(least_height),
        sizes_(subtree_sizes(tree)),
        extras_(extras) {}

  std::vector<OccupancyPiece> run(const TileKey& root) {
    cut(tree_.root, root);
    return std::move(pieces_);
  }

 private:
  void cut(Cell cell, const TileKey& key) {
    if (cell == Cell::unknown) return;
    if (cell != Cell::inner || key.level <= least_height_ || sizes_[key.level][node_[key.level]] <= most_)
      return take(cell, key);
    const std::size_t i = node_[key.level]++;
    const std::uint16_t node = tree_.levels[key.level].nodes[i];
    const auto leaves = leaf_, nodes = node_;
    for (unsigned c = 0; c < 8; ++c) cut(cell_of(node, c), child_key(key, c));
    if (tree_.kind != OccupancyKind::binary) note_extra(key, i, leaves[key.level - 1], nodes[key.level - 1]);
  }

  void take(Cell cell, const TileKey& key) {
    OccupancyTree piece;
    piece.kind = tree_.kind;
    piece.height = key.level;
    piece.root = cell;
    std::size_t inner = cell == Cell::inner ? 1 : 0, leaves = 1 - inner;
    for (unsigned h = key.level;; --h) {
      const OccupancyLevel& from = tree_.levels[h];
      OccupancyLevel& to = piece.levels[h];
      append_range(to.nodes, from.nodes, node_[h], inner);
      append_range(to.node_values, from.node_values, node_[h], inner);
      append_range(to.node_colors, from.node_colors, node_[h], inner);
      append_range(to.leaf_values, from.leaf_values, leaf_[h], leaves);
      append_range(to.leaf_colors, from.leaf_colors, leaf_[h], leaves);
      node_[h] += inner;
      leaf_[h] += leaves;
      inner = leaves = 0;
      if (h == 0) break;
      for (const std::uint16_t node : to.nodes) {
        inner += static_cast<std::size_t>(std::popcount(inner_bits(node)));
        leaves += static_cast<std::size_t>(std::popcount(leaf_bits(node)));
      }
    }
    pieces_.push_back({key, std::move(piece)});
  }

  void note_extra(const TileKey& key, std::size_t i, std::size_t leaf, std::size_t inner) {
    const OccupancyLevel& own = tree_.levels[key.level];
    const OccupancyLevel& below = tree_.levels[key.level - 1];
    NodeSummary s;
    for (unsigned c = 0; c < 8; ++c) {
      const Cell cell = cell_of(own.nodes[i], c);
      if (cell == Cell::unknown) continue;
      const bool is_inner = cell == Cell::inner;
      const std::size_t k = is_inner ? inner++ : leaf++;
      const auto& colors = is_inner ? below.node_colors : below.leaf_colors;
      s.add((is_inner ? below.node_values : below.leaf_values)[k], colors.empty() ? kNoColor : colors[k]);
    }
    const OccupancyColor color = own.node_colors.empty() ? kNoColor : own.node_colors[i];
    const bool same = own.node_values[i] == s.value() && (own.node_colors.empty() || color == s.color());
    if (!same) extras_.push_back({key, own.node_values[i], color});
  }

  const OccupancyTree& tree_;
  std::uint64_t most_;
  std::uint8_t least_height_;
  Sizes sizes_;
  std::vector<OccupancyExtra>& extras_;
  std::array<std::size_t, kOccupancyHeight + 1> leaf_{}, node_{};
  std::vector<OccupancyPiece> pieces_;
};

class Joiner {
 public:
  Joiner(std::span<const OccupancyPiece> pieces, std::span<const OccupancyExtra> extras)
      : pieces_(pieces), extras_(extras.begin(), extras.end()) {
    std::sort(extras_.begin(), extras_.end(),
              [](const auto& a, const auto& b) { return before(a.key, b.key); });
  }

  Result<OccupancyTree> run() {
    if (!pieces_.empty()) tree_.kind = pieces_.front().tree.kind;
    for (const OccupancyPiece& p : pieces_) MAPCODEC_TRY(check(p));
    tree_.root = join({0, 0, 0, kOccupancyHeight});
    if (at_ != pieces_.size())
      return make_error(ErrorCode::kMalformed, "pieces of an octree overlap or are out of order");
    return std::move(tree_);
  }

 private:
  static bool before(const TileKey& a, const TileKey& b) {
    return std::tie(a.level, a.x, a.y, a.z) < std::tie(b.level, b.x, b.y, b.z);
  }

  [[nodiscard]] Status check(const OccupancyPiece& p) const {
    const bool fits = p.key.level <= kOccupancyHeight && p.key.level == p.tree.height &&
                      p.tree.kind == tree_.kind && p.tree.root != Cell::unknown;
    const std::int32_t end = fits ? 1 << (kOccupancyHeight - p.key.level) : 0;
    for (const std::int32_t v : {p.key.x, p.key.y, p.key.z}) {
      if (v < 0 || v >= end) return make_error(ErrorCode::kMalformed, "a piece of an octree does not fit it");
    }
    return {};
  }

  /// Whether the next piece lies within `key`.
  [[nodiscard]] bool next_within(const TileKey& key) const {
    if (at_ == pieces_.size() || pieces_[at_].key.level > key.level) return false;
    const TileKey& k = pieces_[at_].key;
    const int up = key.level - k.level;
    return k.x >> up == key.x && k.y >> up == key.y && k.z >> up == key.z;
  }

  Cell join(const TileKey& key) {
    if (!next_within(key)) return Cell::unknown;
    if (pieces_[at_].key.level == key.level) return append(pieces_[at_++].tree);
    OccupancyLevel& own = tree_.levels[key.level];
    const std::size_t i = own.nodes.size();
    own.nodes.push_back(0);
    const OccupancyLevel& below = tree_.levels[key.level - 1];
    std::uint32_t node = 0;
    NodeSummary s;
    for (unsigned c = 0; c < 8; ++c) {
      const Cell cell = join(child_key(key, c));
      node |= static_cast<std::uint32_t>(cell) << (2 * c);
      if (cell == Cell::unknown || tree_.kind == OccupancyKind::binary) continue;
      const auto& colors = cell == Cell::inner ? below.node_colors : below.leaf_colors;
      s.add((cell == Cell::inner ? below.node_values : below.leaf_values).back(),
            colors.empty() ? kNoColor : colors.back());
    }
    own.nodes[i] = static_cast<std::uint16_t>(node);
    if (tree_.kind != OccupancyKind::binary) set_summary(key, s);
    return Cell::inner;
  }

  // Nodes of one level are finished in the order in which they begin: none lies within another.
  void set_summary(const TileKey& key, const NodeSummary& s) {
    OccupancyLevel& own = tree_.levels[key.level];
    std::uint32_t value = s.value();
    OccupancyColor color = s.color();
    const auto extra = std::lower_bound(extras_.begin(), extras_.end(), key,
                                        [](const auto& e, const TileKey& k) { return before(e.key, k); });
    if (extra != extras_.end() && extra->key == key) value = extra->value, color = extra->color;
    own.node_values.push_back(value);
    if (tree_.kind == OccupancyKind::color) own.node_colors.push_back(color);
  }

  Cell append(const OccupancyTree& piece) {
    const auto all = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    for (unsigned h = 0; h <= piece.height; ++h) {
      OccupancyLevel& to = tree_.levels[h];
      const OccupancyLevel& from = piece.levels[h];
      all(to.nodes, from.nodes);
      all(to.node_values, from.node_values);
      all(to.node_colors, from.node_colors);
      all(to.leaf_values, from.leaf_values);
      all(to.leaf_colors, from.leaf_colors);
    }
    return piece.root;
  }

  std::span<const OccupancyPiece> pieces_;
  std::vector<OccupancyExtra> extras_;
  std::size_t at_ = 0;
  OccupancyTree tree_;
};

}  // namespace

CellCorner corner_of(const TileKey& key) {
  return {static_cast<std::uint32_t>(key.x) << key.level, static_cast<std::uint32_t>(key.y) << key.level,
          static_cast<std::uint32_t>(key.z) << key.level};
}

std::vector<OccupancyPiece> cut_tree(const OccupancyTree& tree, std::uint64_t most_nodes,
                                     std::vector<OccupancyExtra>& extras, const TileKey& root,
                                     std::uint8_t least_height) {
  return Cutter(tree, most_nodes, least_height, extras).run(root);
}

Result<OccupancyTree> join_pieces(std::span<const OccupancyPiece> pieces,
                                  std::span<const OccupancyExtra> extras) {
  return Joiner(pieces, extras).run();
}

}  // namespace mapcodec
