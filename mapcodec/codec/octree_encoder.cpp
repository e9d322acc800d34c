// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/octree_encoder.hpp"

#include <bit>
#include <cassert>
#include <utility>

#include "mapcodec/codec/octree_model.hpp"

namespace mapcodec {
namespace {

using octree::Level;
using octree::Mode;

constexpr std::size_t kMixingPays = std::size_t{1}
                                    << 14;  ///< cells from which mixing is smaller without a trial

/// What the encoder knows of each node, level by level from the root.
struct Truth {
  std::vector<std::uint8_t> mask;    ///< occupied children
  std::vector<std::uint8_t> single;  ///< 1: one voxel below
};

struct EncoderSide {
  RangeEncoder* out;

  bool bit(bool known, BitModel& model) {
    out->encode(known, model);
    return known;
  }
  bool bit(bool known, std::uint32_t p1) {
    out->encode(known, p1);
    return known;
  }
  std::uint32_t mask(bool known, std::uint32_t p1) { return 0 - std::uint32_t{bit(known, p1)}; }
  std::uint64_t integer(std::uint64_t known, IntegerModel& model) {
    model.encode(*out, known);
    return known;
  }
};

/// Merges `keys` into their parents; afterwards keys and singles are the parents'.
Truth merge_level(std::vector<std::uint64_t>& keys, std::vector<std::uint8_t>& singles) {
  Truth truth;
  truth.mask.reserve(keys.size());
  truth.single.reserve(keys.size());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::uint64_t parent = keys[i] >> 3;
    const auto bit = static_cast<std::uint8_t>(1u << (keys[i] & 7));
    if (kept > 0 && keys[kept - 1] == parent) {
      truth.mask.back() |= bit;
      truth.single.back() = 0;
    } else {
      truth.mask.push_back(bit);
      truth.single.push_back(singles[i]);
      keys[kept++] = parent;
    }
  }
  keys.resize(kept);
  singles = truth.single;
  return truth;
}

std::vector<Truth> build_truth(std::vector<std::uint64_t> keys, std::uint32_t depth) {
  std::vector<Truth> levels(depth);
  std::vector<std::uint8_t> singles(keys.size(), 1);
  for (std::uint32_t l = depth; l-- > 0;) levels[l] = merge_level(keys, singles);
  return levels;
}

/// Whether flagging singles is likely to pay: a single saves about three quarters of its flag's cost on each
/// level.
bool singles_pay(const std::vector<Truth>& levels) {
  std::uint64_t saved = 0;  // node levels that cost three bits instead of a mask
  std::uint64_t flags = 0;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const std::size_t nodes = levels[l].mask.size();
    std::size_t single = 0;
    for (const std::uint8_t s : levels[l].single) single += s;
    saved += single;
    if (l + 1 < levels.size()) flags += nodes - single;
  }
  // Every single was flagged once, on the level where it separated; that many flags more. The last level's
  // lone children never were, so they are no singles.
  if (levels.size() < 2) return false;
  const auto& last = levels.back().single;
  const auto& above = levels[levels.size() - 2].single;
  std::size_t inherited = 0;
  for (const std::uint8_t s : above) inherited += s;
  for (const std::uint8_t s : last) saved -= s;
  saved += inherited;
  flags += inherited;
  return 4 * saved >= 3 * flags;
}

void encode_levels(octree::Model<EncoderSide>& model, EncoderSide& side, const std::vector<Truth>& levels,
                   Level& nodes, Level& spare) {
  nodes.make_root();
  const auto depth = static_cast<std::uint32_t>(levels.size());
  for (std::uint32_t l = 0; l < depth; ++l) {
    const Truth& truth = levels[l];
    if (l > 0) {
      std::swap(nodes, spare);
      nodes.append_level(spare, truth.mask.size());
    }
    model.start_level(l, depth - l);
    std::uint32_t before = 0;  // children of earlier nodes
    for (std::uint32_t i = 1; i < nodes.size(); ++i) {
      const std::uint32_t mask =
          model.code_children(side, nodes, i, truth.mask[i - 1], truth.single[i - 1] != 0);
      nodes.links[i] = {before, mask};
      before += kOctantCount[mask];
    }
  }
}

/// Sorted keys and their counts at the depth that contexts code; what lies deeper is the tail.
struct Coarse {
  std::vector<std::uint64_t> keys;
  std::vector<std::uint32_t> counts;
};

Coarse coarsen(std::span<const std::uint64_t> keys, std::span<const std::uint32_t> counts,
               std::uint32_t tail) {
  Coarse c;
  c.keys.reserve(keys.size());
  c.counts.reserve(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::uint64_t key = keys[i] >> (3 * tail);
    const std::uint32_t n = counts.empty() ? 1 : counts[i];
    if (tail > 0 && !c.keys.empty() && c.keys.back() == key) {
      c.counts.back() += n;
    } else {
      c.keys.push_back(key);
      c.counts.push_back(n);
    }
  }
  return c;
}

/// The most levels that can be left raw while nearly every point is alone above them: their bits are noise
/// then.
std::uint32_t choose_tail(std::span<const std::uint64_t> keys, std::span<const std::uint32_t> counts,
                          std::uint32_t depth) {
  std::array<std::uint64_t, 22>
      parting{};  // pairs of neighbours in Morton order that part at this level from below
  std::uint64_t points = 0;
  for (const std::uint32_t n : counts) points += n;
  points = std::max<std::uint64_t>(points, keys.size());
  for (std::size_t i = 1; i < keys.size(); ++i) {
    ++parting[static_cast<std::size_t>(std::bit_width(keys[i] ^ keys[i - 1]) - 1) / 3];
  }
  std::uint64_t crowded = points - keys.size();
  std::uint32_t tail = 0;
  for (; tail < depth; ++tail) {
    crowded += parting[tail];
    if (8 * crowded > points) break;
  }
  return tail;
}

void encode_tail(RangeEncoder& out, std::span<const std::uint64_t> keys,
                 std::span<const std::uint32_t> counts, std::uint32_t tail) {
  if (tail == 0) return;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::uint32_t n = counts.empty() ? 1 : counts[i];
    for (std::uint32_t k = 0; k < n; ++k) out.encode_raw(keys[i], static_cast<int>(3 * tail));
  }
}

void encode_counts(octree::Model<EncoderSide>& model, EncoderSide& side, const Level& parents, Level& leaves,
                   const std::vector<std::uint32_t>& counts, bool root_alone) {
  if (root_alone) {
    leaves.make_root();
  } else {
    leaves.append_level(parents, counts.size());
  }
  std::vector<std::uint32_t> known(counts.size() + 1, 0);
  for (std::uint32_t i = 1; i <= counts.size(); ++i) {
    model.code_count(side, leaves.nodes[i], known, i, counts[i - 1]);
    known[i] = counts[i - 1];
  }
}

Mode choose_mode(const Coarse& coarse, const std::vector<Truth>& levels, std::uint32_t tail, Effort effort) {
  Mode mode;
  mode.mixing = effort == Effort::high;
  mode.counts =
      std::any_of(coarse.counts.begin(), coarse.counts.end(), [](std::uint32_t n) { return n != 1; });
  mode.singles = singles_pay(levels);
  mode.tail = static_cast<std::uint8_t>(tail);
  return mode;
}

/// All that is known of one octree before its mode is chosen.
struct Task {
  std::span<const std::uint64_t> keys;
  std::span<const std::uint32_t> counts;
  Coarse coarse;
  std::vector<Truth> levels;
};

Bytes encode_in(const Mode& mode, const Task& task) {
  RangeEncoder out;
  EncoderSide side{&out};
  octree::Model<EncoderSide> model(mode);
  Level nodes, spare;
  encode_levels(model, side, task.levels, nodes, spare);
  if (mode.counts) encode_counts(model, side, nodes, spare, task.coarse.counts, task.levels.empty());
  encode_tail(out, task.keys, task.counts, mode.tail);
  Bytes bytes{mode.byte()};
  const Bytes code = out.finish();
  bytes.insert(bytes.end(), code.begin(), code.end());
  return bytes;
}

}  // namespace

Bytes encode_octree(std::span<const std::uint64_t> keys, std::span<const std::uint32_t> counts,
                    std::uint32_t depth, const OctreeSettings& settings) {
  assert(!keys.empty() && depth <= 21);
  if (!settings.keep_counts) counts = {};
  const std::uint32_t tail = settings.effort == Effort::fast ? choose_tail(keys, counts, depth) : 0;
  Task task{keys, counts, coarsen(keys, counts, tail), {}};
  task.levels = build_truth(task.coarse.keys, depth - tail);
  Mode mode = choose_mode(task.coarse, task.levels, tail, settings.effort);
  Bytes bytes = encode_in(mode, task);
  // Few nodes do not teach a mixer enough to be sure of its gain.
  if (mode.mixing && task.coarse.keys.size() < kMixingPays) {
    mode.mixing = false;
    Bytes plain = encode_in(mode, task);
    if (plain.size() <= bytes.size()) return plain;
  }
  return bytes;
}

}  // namespace mapcodec
