// SPDX-License-Identifier: GPL-3.0-or-later
// The breadth-first walk over a surface tree that encoder and decoder share (FORMAT.md 10.3): who writes
// hands in what it chose, who reads gets it.
#pragma once

#include <span>
#include <vector>

#include "mapcodec/codec/surface_model.hpp"

namespace mapcodec::surface {

/// What an encoder decided about one cell.
struct Choice {
  bool own_plane = false;
  bool divided = false;
  bool wedged = false;
  bool block = false;      ///< undivided as a cell, divided as voxels: the children say which there are
  std::uint8_t noise = 0;  ///< of a leaf or a block
  Wedge wedge;
  Plane plane;                                ///< own_plane only
  std::uint32_t count = 0;                    ///< points
  std::uint32_t least_count = 1;              ///< with fewer points some of the choices below cannot be said
  std::array<std::int32_t, 2> child{-1, -1};  ///< choices of the halves, -1: holds no point
};

/// A cell that is not divided: `count` points on its plane, or at its centre.
struct Leaf {
  std::array<std::uint32_t, 3> at;  ///< lowest corner [units from the tile's base]
  CellShape shape;
  std::uint32_t count;
  bool has_plane = false, wedged = false;
  Plane plane;
  Wedge wedge;
  std::int32_t block = -1;  ///< of a voxel: its block, which has the count
  std::uint8_t noise = 0;
  std::int32_t seam = -1;  ///< what its neighbours change, if anything
};

/// Two leaves with planes that touch: `to` beyond a face of `from`, as large or larger.
struct Joint {
  std::int32_t from, to;
  std::uint8_t face;  ///< 2 axis, 1 more for the upper one
};
inline constexpr std::uint32_t kLeastJoined = 6;  ///< points of leaves that joints are noted of

/// A cell whose occupied voxels are told.
struct Block {
  std::uint32_t count;  ///< points
  std::uint8_t noise;
};

inline constexpr std::uint32_t kLeastInBlock = 4;
/// Binary levels from a cell down to voxels of 2^v units; 0 where a block is not allowed.
[[nodiscard]] constexpr int block_levels(const CellShape& shape, int v) {
  if (shape[0] < v || shape[1] < v || shape[2] < v) return 0;
  const int levels = shape[0] + shape[1] + shape[2] - 3 * v;
  return levels <= 9 ? levels : 0;
}

template <class Side>
class Walk {
 public:
  /// @param choices  of an encoder; choices[0] is the root's.
  explicit Walk(Side& side, std::span<const Choice> choices = {}) : side_(side), choices_(choices) {}

  /// Codes the tree over a root cube of 2^depth units with `count` >= 1 points.
  /// @param stop  binary levels that are coded; cells still divided there become leaves (3 depth: all).
  /// @return false if the bytes are damaged.
  bool run(std::uint32_t count, std::uint8_t depth, unsigned stop) {
    shape_ = {depth, depth, depth};
    Cell root;
    root.count = count;
    root.link.fill(kNone);
    cells_.assign(1, root);
    next_.clear();
    for (unsigned level = 0; !cells_.empty(); ++level) {
      const bool last = level >= stop || level >= 3u * depth;
      for (std::size_t i = 0; i < cells_.size(); ++i) {
        if (!side_.ok()) return false;
        if (last) {
          add_leaf(cells_[i], {}, nullptr, true);
        } else {
          code_cell(i, level % 3);
        }
      }
      note_joints();
      if constexpr (requires { side_.end_level(); }) side_.end_level();
      // Every cell holds a point: more of them come only from damaged bytes.
      if (last || next_.size() > count) break;
      link_children(level % 3);
      --shape_[level % 3];
      cells_.swap(next_);
      next_.clear();
    }
    return side_.ok() && next_.empty();
  }

  /// Voxels among them have neither count nor plane until settle_blocks gives them.
  [[nodiscard]] std::vector<Leaf>& leaves() { return leaves_; }
  [[nodiscard]] const std::vector<Block>& blocks() const { return blocks_; }
  [[nodiscard]] const std::vector<Joint>& joints() const { return joints_; }
  Models& models() { return models_; }

 private:
  static constexpr std::int32_t kNone = -1;  // links below: -2 - leaf; from 0: cells of this level
  enum class State : std::uint8_t { unknown, leaf, divided };
  struct Cell {
    std::array<std::uint32_t, 3> at{0, 0, 0};
    std::uint32_t count = 0;
    std::array<std::int32_t, 6> link;  ///< neighbours at the lower and upper face of x, y, z
    std::array<std::int32_t, 2> child{kNone, kNone};
    std::int32_t leaf = kNone;
    std::int32_t choice = 0;
    std::int32_t block = kNone;
    State state = State::unknown;
    bool has_plane = false;
    Plane plane;
  };

  CellContext context(std::size_t me, unsigned axis) const {
    const Cell& cell = cells_[me];
    CellContext c;
    c.size = size_of(shape_);
    c.crowd = cell.block >= 0 ? kUncounted : crowd_of(cell.count);
    int leaves = 0, divided = 0;
    for (unsigned f = 0; f < 6; ++f) {
      const std::int32_t l = cell.link[f];
      if (l == kNone) continue;
      const bool decoded = l < 0 || static_cast<std::size_t>(l) < me;
      const bool is_divided =
          decoded && l >= 0 && cells_[static_cast<std::size_t>(l)].state == State::divided;
      leaves += decoded && !is_divided;
      divided += is_divided;
      if (f / 2 == axis) {
        (f % 2 == 0 ? c.below : c.above) += 1;
      } else if (is_divided) {
        c.below += cells_[static_cast<std::size_t>(l)].child[0] != kNone;
        c.above += cells_[static_cast<std::size_t>(l)].child[1] != kNone;
      }
    }
    c.below = std::min(3, c.below);
    c.above = std::min(3, c.above);
    c.neighbors = divided == 0 ? (leaves == 0 ? 0 : 1) : (leaves == 0 ? 3 : 2);
    return c;
  }

  void code_cell(std::size_t i, unsigned axis) {
    Cell cell = cells_[i];
    const CellContext c = context(i, axis);
    const Choice* choice = choices_.empty() ? nullptr : &choices_[static_cast<std::size_t>(cell.choice)];
    if (cell.block >= 0) {
      code_block_cell(cell, c, axis, choice);
      cells_[i] = cell;
      return;
    }
    bool own = false;
    if (cell.count >= 3) {
      own = models_.own_plane(side_, choice != nullptr && choice->own_plane, c, cell.has_plane);
      if (own) {
        Plane expected;
        const bool guessed = expect(cell, expected);
        cell.plane = models_.plane(side_, choice != nullptr ? choice->plane : Plane{},
                                   guessed ? &expected : nullptr, shape_, c);
        cell.has_plane = true;
      }
    }
    const bool divided =
        models_.divided(side_, choice != nullptr && choice->divided, c, own ? 2 : (cell.has_plane ? 1 : 0));
    const int plane = own ? 2 : (cell.has_plane ? 1 : 0);
    if (!divided && can_be_block(cell) &&
        models_.block(side_, choice != nullptr && choice->block, c, plane)) {
      cell.block = static_cast<std::int32_t>(blocks_.size());
      blocks_.push_back(
          {cell.count, models_.noise(side_, choice != nullptr ? choice->noise : std::uint8_t{0}, c, true)});
    }
    cell.state = divided || cell.block >= 0 ? State::divided : State::leaf;
    if (cell.state == State::divided) {
      divide(cell, c, axis, choice);
    } else {
      add_leaf(cell, c, choice, false);
    }
    cells_[i] = cell;
  }

  [[nodiscard]] bool can_be_block(const Cell& cell) const {
    const int v = models_.voxel_bits;
    return v > 0 && cell.count >= kLeastInBlock && block_levels(shape_, v) > 0;
  }

  void code_block_cell(Cell& cell, const CellContext& c, unsigned axis, const Choice* choice) {
    const int v = models_.voxel_bits;
    if (shape_[0] + shape_[1] + shape_[2] == 3 * v) {
      cell.state = State::leaf;
      add_leaf(cell, c, nullptr, true);
    } else {
      cell.state = State::divided;
      divide(cell, c, axis, choice);
    }
  }

  /// The plane that a new one is coded against: the inherited one, or that of the neighbour which comes
  /// nearest to the cell's centre.
  bool expect(const Cell& cell, Plane& expected) const {
    if (cell.has_plane) {
      expected = cell.plane;
      return true;
    }
    std::int64_t nearest = kMostHeight;
    bool found = false;
    const auto consider = [&](const Plane& p, const std::array<std::uint32_t, 3>& at,
                              const CellShape& shape) {
      const Plane here = seen_from(p, at, shape, cell.at, shape_);
      const std::int64_t h = here.h < 0 ? -std::int64_t{here.h} : here.h;
      if (h > half_side(shape_[here.axis]) || h >= nearest) return;
      nearest = h;
      expected = here;
      found = true;
    };
    for (const std::int32_t l : cell.link) {
      if (l >= 0) {
        const Cell& n = cells_[static_cast<std::size_t>(l)];
        if (n.has_plane && n.state != State::unknown) consider(n.plane, n.at, shape_);
      } else if (l < kNone) {
        const Leaf& n = leaves_[static_cast<std::size_t>(-2 - l)];
        if (n.has_plane) consider(n.plane, n.at, n.shape);
      }
    }
    return found;
  }

  void divide(Cell& cell, const CellContext& c, unsigned axis, const Choice* choice) {
    const int share = cell.has_plane
                          ? lower_share(cell.plane, shape_, Room::in(models_.outline, cell.at, shape_), axis)
                          : -1;
    int halves = 0;
    std::uint32_t lower = 0;
    if (choice != nullptr) {
      halves = choice->child[0] < 0 ? 2 : (choice->child[1] < 0 ? 1 : 0);
      if (halves == 0) {
        const Choice& below = choices_[static_cast<std::size_t>(choice->child[0])];
        const Choice& above = choices_[static_cast<std::size_t>(choice->child[1])];
        if (cell.block >= 0) {
          lower = 0;
        } else if (cell.count == 1) {
          halves = below.count >= above.count ? 1 : 2;
        } else {
          lower = static_cast<std::uint32_t>((std::uint64_t{cell.count} * below.count + choice->count / 2) /
                                             choice->count);
          const std::uint32_t most = cell.count > above.least_count ? cell.count - above.least_count : 1;
          const std::uint32_t least = std::min(below.least_count, most);
          lower = models_.sayable_count(std::clamp(lower, least, most), least, most, cell.count, share);
        }
      }
    }
    halves = models_.halves(side_, halves, cell.block >= 0 ? 2 : cell.count, c, share);
    if (cell.block < 0)
      lower =
          halves == 1 ? cell.count : (halves == 2 ? 0 : models_.lower_count(side_, lower, cell.count, share));
    const std::uint8_t side = shape_[axis];
    for (unsigned h = 0; h < 2; ++h) {
      if (halves == static_cast<int>(2 - h)) continue;
      Cell child;
      child.at = cell.at;
      child.at[axis] += h == 0 ? 0 : 1u << (side - 1);
      child.block = cell.block;
      child.count = cell.block >= 0 ? 0 : (h == 0 ? lower : cell.count - lower);
      child.has_plane = cell.has_plane;
      if (cell.has_plane) child.plane = in_child(cell.plane, axis, h == 1, side);
      if (choice != nullptr) child.choice = choice->child[h];
      cell.child[h] = static_cast<std::int32_t>(next_.size());
      next_.push_back(child);
    }
  }

  void add_leaf(Cell& cell, const CellContext& c, const Choice* choice, bool last) {
    Leaf leaf{cell.at, shape_, cell.count, cell.has_plane, false, cell.plane, {}, cell.block, 0};
    if (cell.has_plane && cell.count >= 6 && !last) {
      leaf.wedged = models_.wedge(side_, choice != nullptr && choice->wedged, c);
      leaf.noise = models_.noise(side_, choice != nullptr ? choice->noise : std::uint8_t{0}, c, false);
      if (leaf.wedged) leaf.wedge = models_.wedge_line(side_, choice != nullptr ? choice->wedge : Wedge{});
    }
    cell.leaf = static_cast<std::int32_t>(leaves_.size());
    leaves_.push_back(leaf);
  }

  [[nodiscard]] static bool can_join(const Leaf& leaf) {
    return leaf.has_plane && leaf.block < 0 && leaf.count >= kLeastJoined;
  }

  /// Notes each pair of this level's leaves and earlier ones once.
  void note_joints() {
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const Cell& cell = cells_[i];
      if (cell.state != State::leaf || !can_join(leaves_[static_cast<std::size_t>(cell.leaf)])) continue;
      for (unsigned f = 0; f < 6; ++f) {
        const std::int32_t l = cell.link[f];
        if (l == kNone || (l >= 0 && static_cast<std::size_t>(l) > i)) continue;
        const bool is_leaf = l < 0 || cells_[static_cast<std::size_t>(l)].state == State::leaf;
        if (!is_leaf) continue;
        const std::int32_t to = l < 0 ? -2 - l : cells_[static_cast<std::size_t>(l)].leaf;
        if (can_join(leaves_[static_cast<std::size_t>(to)]))
          joints_.push_back({cell.leaf, to, static_cast<std::uint8_t>(f)});
      }
    }
  }

  /// Gives the children their neighbours, now that all of this level is known.
  void link_children(unsigned axis) {
    for (const Cell& cell : cells_) {
      for (unsigned h = 0; h < 2; ++h) {
        if (cell.child[h] == kNone) continue;
        auto& link = next_[static_cast<std::size_t>(cell.child[h])].link;
        for (unsigned f = 0; f < 6; ++f) {
          if (f / 2 != axis) {
            link[f] = follow(cell.link[f], h);
          } else if (f % 2 == h) {
            link[f] = follow(cell.link[f], 1 - h);
          } else {
            link[f] = cell.child[1 - h];
          }
        }
      }
    }
  }

  std::int32_t follow(std::int32_t l, unsigned half) const {
    if (l < 0) return l;
    const Cell& n = cells_[static_cast<std::size_t>(l)];
    return n.state == State::leaf ? -2 - n.leaf : n.child[half];
  }

  Side& side_;
  std::span<const Choice> choices_;
  Models models_;
  CellShape shape_{};
  std::vector<Cell> cells_, next_;
  std::vector<Leaf> leaves_;
  std::vector<Block> blocks_;
  std::vector<Joint> joints_;
};

}  // namespace mapcodec::surface
