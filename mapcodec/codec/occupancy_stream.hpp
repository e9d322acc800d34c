// SPDX-License-Identifier: GPL-3.0-or-later
// The order in which a tree is coded, for both directions (FORMAT.md 12): level by level from the root, in
// each the structure, then the leaves' log-odds and colours; last, inner nodes that are not what their
// children say. `Side` adds to what the models ask of it
//   static constexpr bool kDecodes   whether the tree is filled or read
//   static constexpr bool kValued    whether leaves have log-odds: such trees have another code
//   bool ok()                        whether there was enough of it
#pragma once

#include <type_traits>

#include "mapcodec/codec/occupancy_leaves.hpp"
#include "mapcodec/codec/occupancy_model.hpp"
#include "mapcodec/codec/occupancy_pairs.hpp"

namespace mapcodec::occupancy {

/// Numbers that both sides know before the first symbol.
struct StreamHead {
  std::uint64_t inner = 0, leaves = 0;
  bool exceptions = false;  ///< inner nodes may differ from what their children make of them
};

template <class Side>
class Stream {
 public:
  Stream(Side& side, const StreamHead& head, const ValueTable& table)
      : side_(side), head_(head), structure_(head.inner), leaf_stream_(table) {}

  Status run(OccupancyTree& tree) {
    if (tree.root != Cell::inner) return code_root(tree);
    Layer layer, below;
    layer.make_root();
    for (unsigned h = tree.height; h > 0 && layer.size() > 0; --h) {
      MAPCODEC_TRY(code_structure(tree.levels[h], layer, h));
      layer.count_children();
      MAPCODEC_TRY(check_counts(layer, h));
      MAPCODEC_TRY(code_leaves(tree.levels[h - 1], layer, h, tree.kind));
      below.make_children(layer);
      std::swap(layer, below);
    }
    if (Side::kDecodes && (inner_ != head_.inner || leaves_ != head_.leaves))
      return make_error(ErrorCode::kMalformed, "octree has fewer nodes than its header says");
    if constexpr (Side::kValued) leaf_stream_.code_nodes(side_, tree, head_.exceptions);
    return Side::kDecodes && !side_.ok() ? Status(ended()) : Status{};
  }

 private:
  static Error ended() { return make_error(ErrorCode::kTruncated, "occupancy code ends too early"); }

  Status code_structure(OccupancyLevel& level, Layer& layer, unsigned height) {
    layer.open();
    if constexpr (Side::kDecodes) level.nodes.resize(layer.size());
    Side side = side_;  // in registers
    for (std::size_t i = 0; i < layer.size(); ++i) {
      const std::uint16_t node = structure_.code(side, layer, i, height, level.nodes[i]);
      if constexpr (Side::kDecodes) {
        level.nodes[i] = node;
        if (node == 0) return make_error(ErrorCode::kMalformed, "octree has an inner node without children");
        if (!side.ok()) return ended();
      }
      layer.nodes[kFirstNode + i] = node;
    }
    side_ = side;
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
    if constexpr (Side::kValued) {
      const char* const wrong = leaf_stream_.code(side_, level, layer, height, kind);
      if (Side::kDecodes && !side_.ok()) return ended();
      if (wrong != nullptr) return make_error(ErrorCode::kMalformed, wrong);
    }
    return {};
  }

  struct NoLeaves {
    explicit NoLeaves(const ValueTable&) {}
  };

  Side& side_;
  StreamHead head_;
  std::conditional_t<Side::kValued, PairModel, StructureModel> structure_;
  std::conditional_t<Side::kValued, LeafStream<Side>, NoLeaves> leaf_stream_;
  std::uint64_t inner_ = 0, leaves_ = 0;
};

}  // namespace mapcodec::occupancy
