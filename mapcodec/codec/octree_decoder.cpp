// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/octree_decoder.hpp"

#include <bit>
#include <utility>

#include "mapcodec/codec/octree_model.hpp"
#include "mapcodec/codec/octree_points.hpp"
#include "mapcodec/geometry/morton.hpp"

namespace mapcodec {
namespace {

using octree::Level;
using octree::Mode;

struct DecoderSide {
  RangeDecoder in;

  bool bit(bool, BitModel& model) { return in.decode(model); }
  bool bit(bool, std::uint32_t p1) { return in.decode(p1); }
  std::uint32_t mask(bool, std::uint32_t p1) { return in.decode_mask(p1); }
  std::uint64_t integer(std::uint64_t, IntegerModel& model) { return model.decode(in); }
};

Error ended() {
  return make_error(ErrorCode::kTruncated, "octree code ends too early");
}

/// Decodes one stream; members are its state from level to level.
class OctreeReader {
 public:
  OctreeReader(ByteSpan code, const Mode& mode, std::uint64_t points, const DecodeLimits& limits)
      : side_{RangeDecoder(code)}, mode_(mode), points_(points), limits_(limits), model_(mode) {}

  Result<std::vector<VoxelCoord>> read(std::uint32_t depth) {
    nodes_.make_root();
    for (std::uint32_t l = 0; l < depth; ++l) {
      MAPCODEC_TRY(read_level(l, depth - l));
      MAPCODEC_TRY(descend());
    }
    MAPCODEC_TRY(read_counts());
    if (mode_.tail > 0) return read_tail();
    return expand();
  }

 private:
  /// Calls `f(i)` for each node of the current level as soon as it is made of its parent, until one is false:
  /// while the code decides the masks bit after bit, the processor can already make the nodes that follow.
  template <class F>
  bool for_each_node(F&& f) {
    if (at_root_) return f(1);
    for (std::uint32_t p = 1; p < parents_.size(); ++p) {
      for (std::uint32_t left = parents_.links[p].mask; left != 0; left &= left - 1) {
        if (!f(nodes_.append_child(parents_, p, static_cast<std::uint32_t>(std::countr_zero(left)))))
          return false;
      }
    }
    return true;
  }

  Status read_level(std::uint32_t bits, std::uint32_t below) {
    model_.start_level(bits, below);
    std::uint32_t children = 0;
    const bool whole = for_each_node([&](std::uint32_t i) {
      const std::uint32_t mask = model_.code_children(side_, nodes_, i, 0, false);
      nodes_.links[i] = {children, mask};
      children += kOctantCount[mask];
      return side_.in.ok();
    });
    if (!whole) return ended();
    if (children > points_) return make_error(ErrorCode::kMalformed, "octree has more cells than points");
    children_ = children;
    return {};
  }

  /// Makes the current level the parents of the next, whose nodes are still to be made.
  Status descend() {
    constexpr std::uint64_t kPerNode = 2 * (sizeof(octree::Node) + sizeof(octree::Link) + sizeof(VoxelCoord));
    if ((children_ + 1) * kPerNode > limits_.max_bytes) {
      return make_error(ErrorCode::kLimitExceeded, "octree needs more memory than allowed");
    }
    std::swap(nodes_, parents_);
    nodes_.reset(children_);
    at_root_ = false;
    return {};
  }

  Status read_counts() {
    const std::size_t leaves = at_root_ ? 1 : children_;
    counts_.assign(mode_.counts ? leaves + 1 : 0, 0);
    std::uint64_t sum = 0;
    const bool whole = for_each_node([&](std::uint32_t i) {
      const std::uint64_t n = mode_.counts ? model_.code_count(side_, nodes_.nodes[i], counts_, i, 0) : 1;
      if (n == 0 || n > points_ - sum) return false;
      if (mode_.counts) counts_[i] = static_cast<std::uint32_t>(n);
      sum += n;
      return side_.in.ok();
    });
    if (!whole && side_.in.ok()) return make_error(ErrorCode::kMalformed, "octree counts exceed the points");
    return check_sum(sum);
  }

  Status check_sum(std::uint64_t sum) const {
    if (!side_.in.ok()) return ended();
    if (sum == points_) return {};
    return make_error(ErrorCode::kMalformed, "octree holds another number of points than declared");
  }

  [[nodiscard]] std::uint32_t count(std::uint32_t i) const { return mode_.counts ? counts_[i] : 1; }

  std::vector<VoxelCoord> expand() const {
    std::vector<VoxelCoord> cells;
    cells.reserve(points_);
    for (std::uint32_t i = 1; i < nodes_.size(); ++i) {
      for (std::uint32_t left = count(i); left > 0; --left) cells.push_back(nodes_.nodes[i].at);
    }
    return cells;
  }

  Result<std::vector<VoxelCoord>> read_tail() {
    std::vector<VoxelCoord> cells;
    for (std::uint32_t i = 1; i < nodes_.size(); ++i) {
      std::uint64_t last = 0;
      for (std::uint32_t k = 0; k < count(i); ++k) {
        const std::uint64_t low = side_.in.decode_raw(3 * mode_.tail);
        if (!side_.in.ok()) return ended();
        if (low < last) return make_error(ErrorCode::kMalformed, "octree tail is not in order");
        last = low;
        cells.push_back(below(nodes_.nodes[i].at, low));
      }
    }
    return cells;
  }

  [[nodiscard]] VoxelCoord below(const VoxelCoord& at, std::uint64_t key) const {
    VoxelCoord v = morton_decode(key);
    for (std::size_t axis = 0; axis < 3; ++axis) v[axis] |= at[axis] << mode_.tail;
    return v;
  }

  DecoderSide side_;
  Mode mode_;
  std::uint64_t points_;
  DecodeLimits limits_;
  octree::Model<DecoderSide> model_;
  Level nodes_, parents_;
  std::uint64_t children_ = 0;
  bool at_root_ = true;  ///< the current level is the root's
  std::vector<std::uint32_t> counts_;
};

Status check_request(std::uint64_t points, std::uint32_t depth, const DecodeLimits& limits) {
  if (points == 0) return make_error(ErrorCode::kMalformed, "octree without points");
  if (depth > kMortonBits) return make_error(ErrorCode::kMalformed, "octree deeper than 21 levels");
  const std::uint64_t most = std::min<std::uint64_t>(limits.max_points, std::uint64_t{1} << 31);
  if (points > most || points > limits.max_bytes / sizeof(VoxelCoord)) {
    return make_error(ErrorCode::kLimitExceeded, "octree has more points than allowed");
  }
  return {};
}

}  // namespace

Result<std::vector<VoxelCoord>> decode_octree_points(ByteSpan bytes, std::uint64_t points,
                                                     std::uint32_t depth, const DecodeLimits& limits) {
  MAPCODEC_TRY(check_request(points, depth, limits));
  if (bytes.empty()) return make_error(ErrorCode::kTruncated, "octree without its mode byte", 0);
  const Mode mode = Mode::from(bytes[0]);
  if (mode.tail > depth) return make_error(ErrorCode::kMalformed, "octree tail longer than its depth", 0);
  OctreeReader reader(bytes.subspan(1), mode, points, limits);
  return reader.read(depth - mode.tail);
}

Result<DecodedOctree> decode_octree(ByteSpan bytes, std::uint64_t points, std::uint32_t depth,
                                    const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const std::vector<VoxelCoord> cells, decode_octree_points(bytes, points, depth, limits));
  DecodedOctree octree;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0 && cells[i] == cells[i - 1]) {
      ++octree.counts.back();
    } else {
      octree.keys.push_back(morton_encode(cells[i]));
      octree.counts.push_back(1);
    }
  }
  return octree;
}

}  // namespace mapcodec
