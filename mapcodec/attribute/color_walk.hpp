// SPDX-License-Identifier: GPL-3.0-or-later
// The transform: region-adaptive Haar over the tree, top down, each cell's children predicted from the
// decoded cells around it [de Queiroz and Chou 2016; Lasserre and Flynn 2019]. Worked in mean values, not in
// coefficients: a split of weights v, w has one orthonormal coefficient, sqrt(v w / (v + w)) times the
// difference of the two means, so a difference is quantised with the step divided by that root. Integers
// only.
#pragma once

#include <bit>
#include <cmath>

#include "mapcodec/attribute/color_space.hpp"
#include "mapcodec/attribute/color_tree.hpp"
#include "mapcodec/geometry/octants.hpp"

namespace mapcodec {

struct ColorSettings {
  std::uint32_t step = 16;   ///< quantiser step of the orthonormal coefficients, 1/16 of an 8-bit level
  std::uint32_t levels = 0;  ///< levels whose splits are coded; deeper ones are only predicted
  bool split_cells = false;  ///< points that share a finest cell get values of their own
  ColorScale scale = ColorScale::eight;
  bool coarse = false;     ///< for steps so wide that most splits have no symbols (FORMAT.md 8.6)
  std::uint8_t trust = 0;  ///< coarse: how much of a predicted difference is believed, 1/16
};
inline constexpr std::uint8_t kMostTrust = 64;

/// What is known of a split before its symbols.
struct SplitContext {
  std::uint32_t gain = 0;    ///< binary logarithm of v w / (v + w), 0..15
  std::uint32_t around = 0;  ///< symbols of the cells around, 0..5
  std::uint32_t above = 0;   ///< symbols of the cell above, 0..3
  // Coarse settings only. Symbols, sizes: their bit lengths.
  std::uint32_t beside = 0;    ///< symbols of the cell before and those before across faces, 0..11
  std::uint32_t handed = 0;    ///< symbols of the cell above, 0..8
  std::uint32_t diagonal = 0;  ///< symbols of the cells before across edges, 0..11
  std::uint32_t ahead = 0;     ///< symbols above the cells around that come later, 0..11
  std::uint32_t here = 0;      ///< symbols of the cell itself so far, 0..7
  std::uint32_t busy = 0;      ///< of `beside`, `handed` and `here` together, 0..11
  std::array<std::uint32_t, 3> contrast{};  ///< largest difference to a cell around, 1/16 step, 0..11
  std::array<std::uint32_t, 3> expected{};  ///< size of the predicted difference, 1/16 step, 0..7
  ColorPoint predicted{};
};

/// v w / (v + w) in 1/65536.
[[nodiscard]] inline std::uint64_t split_gain(std::uint64_t v, std::uint64_t w) {
  const std::uint64_t product = v * w, sum = v + w;
  return ((product / sum) << 16) + (((product % sum) << 16) / sum);
}
/// Its root in 1/256. IEEE square roots are exact to the last bit, so the whole part is the same everywhere.
[[nodiscard]] inline std::uint64_t split_root(std::uint64_t gain) {
  return static_cast<std::uint64_t>(std::sqrt(static_cast<double>(gain)));
}

/// a / b, towards zero. Most weights are small: then a multiplication, exact since a's error, below 2^27 /
/// 2^31, is less than the 1/15 that a quotient may lack to the next integer.
[[nodiscard]] inline std::int64_t divide_by_weight(std::int64_t a, std::int64_t b) {
  constexpr std::int64_t kMost = std::int64_t{1} << 27;
  constexpr auto kInverse = [] {
    std::array<std::int64_t, 16> t{};
    for (std::int64_t w = 1; w < 16; ++w) t[static_cast<std::size_t>(w)] = (std::int64_t{1} << 31) / w + 1;
    return t;
  }();
  if (b >= 16 || a >= kMost || a <= -kMost) return a / b;
  const std::int64_t sign = a >> 63;  // 0 or -1
  const std::int64_t q = (((a ^ sign) - sign) * kInverse[static_cast<std::size_t>(b)]) >> 31;
  return (q ^ sign) - sign;
}

/// Policy: `std::array<std::int64_t, 3> code(const SplitContext&, const ColorPoint& wanted, const ColorPoint&
/// steps)` gives the quantised differences; `wanted` (difference less prediction) means something only if
/// Policy::kKnows, and then `sum(node)` gives the sums of the original values of the level's cells, and
/// `enter_split(begin, middle, end)` tells which points are split.
template <class Policy>
class ColorWalk {
 public:
  ColorWalk(const ColorTree& tree, const ColorSettings& settings, Policy& policy)
      : tree_(tree), settings_(settings), policy_(policy) {
    for (std::size_t c = 0; c < 3; ++c) {
      steps_[c] = static_cast<std::int64_t>(settings.step) * kColorLength[c] << (kColorFraction - 4);
    }
    for (std::size_t v = 1; v < kSmall; ++v) {
      for (std::size_t w = 1; w < kSmall; ++w) small_[v * kSmall + w] = split_scale(v, w);
    }
    for (std::size_t c = 0; c < 3; ++c) per_doubt_[c] = (std::int64_t{1} << 40) / ((steps_[c] >> 7) + 1);
  }

  /// @return the decoded mean of each finest cell. False in `policy_.ok()` ends it early.
  std::vector<ColorPoint> run(const ColorPoint& root) {
    means_.assign(1, root);
    activity_.assign(1, 0);
    for (std::size_t l = 0; l + 1 < tree_.levels().size() && policy_.ok(); ++l) descend(l);
    return std::move(means_);
  }

  /// Splits points [begin, end) of a finest cell of mean `m` by halves.
  template <class Leaf>
  void split_cell(std::uint32_t begin, std::uint32_t end, const ColorPoint& m, Leaf&& leaf) {
    if (end - begin == 1 || !policy_.ok()) {
      for (std::uint32_t i = begin; i < end; ++i) leaf(i, m);
      return;
    }
    const std::uint32_t middle = begin + (end - begin + 1) / 2;
    ColorPoint wanted{};
    if constexpr (Policy::kKnows) {
      const ColorPoint a = policy_.mean(begin, middle), b = policy_.mean(middle, end);
      for (std::size_t c = 0; c < 3; ++c) wanted[c] = b[c] - a[c];
    }
    context_ = {0, 0, 0};
    const auto [low, high] = split(m, middle - begin, end - middle, {}, wanted, true);
    split_cell(begin, middle, low, leaf);
    split_cell(middle, end, high, leaf);
  }

 private:
  /// Children of a node, grouped: [8..15] octants, [4..7] pairs along x, [2..3] quads, [1] all.
  struct Groups {
    std::array<std::int64_t, 16> weight{};
    std::array<ColorPoint, 16> predicted;  ///< weighted sums
    std::array<ColorPoint, 16> truth;      ///< sums of the originals
    std::array<ColorPoint, 16> mean;
    std::array<std::uint32_t, 16> begin{}, end{};  ///< points
  };

  void descend(std::size_t l) {
    const ColorLevel &level = tree_.levels()[l], &below = tree_.levels()[l + 1];
    coded_ = l < settings_.levels;
    next_.resize(below.size());
    next_activity_.assign(below.size(), 0);
    node_activity_.assign(level.size(), 0);
    if constexpr (Policy::kKnows) policy_.enter(l + 1);
    for (std::uint32_t n = 0; n < level.size(); ++n) {
      const ColorNode& node = level.nodes[n];
      if (std::has_single_bit(node.mask)) {
        next_[node.child] = means_[n];
        next_activity_[node.child] = activity_[n];
      } else if (!policy_.ok()) {
        return;
      } else {
        split_node(level, below, n);
      }
    }
    means_.swap(next_);
    activity_.swap(next_activity_);
  }

  void split_node(const ColorLevel& level, const ColorLevel& below, std::uint32_t n) {
    const ColorNode& node = level.nodes[n];
    load_groups(level, below, n);
    symbols_ = 0;
    set_context(level, n);
    groups_.mean[1] = means_[n];
    for (std::size_t g = 1; g < 8; ++g) {
      if (groups_.weight[g] > 0) split_group(g);
    }
    std::uint32_t at = node.child;
    const auto activity = static_cast<std::uint8_t>(std::min<std::uint32_t>(symbols_, 255));
    node_activity_[n] = activity;
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      if (((node.mask >> octant) & 1) == 0) continue;
      next_[at] = groups_.mean[8 + octant];
      next_activity_[at++] = activity;
    }
  }

  void load_groups(const ColorLevel& level, const ColorLevel& below, std::uint32_t n) {
    const ColorNode& node = level.nodes[n];
    groups_.weight.fill(0);
    std::uint32_t at = node.child;
    for (std::uint32_t octant = 0; octant < 8; ++octant) {
      if (((node.mask >> octant) & 1) == 0) continue;
      const std::int64_t weight = below.weight(at);
      const ColorPoint p = predict(level, n, octant);
      groups_.weight[8 + octant] = weight;
      for (std::size_t c = 0; c < 3; ++c) groups_.predicted[8 + octant][c] = p[c] * weight;
      if constexpr (Policy::kKnows) {
        groups_.truth[8 + octant] = policy_.sum(at);
        groups_.begin[8 + octant] = below.nodes[at].begin;
        groups_.end[8 + octant] = below.nodes[at + 1].begin;
      }
      ++at;
    }
    for (std::size_t g = 7; g >= 1; --g) join_groups(g);
  }

  void join_groups(std::size_t g) {
    const std::size_t a = 2 * g, b = 2 * g + 1;
    groups_.weight[g] = groups_.weight[a] + groups_.weight[b];
    if (groups_.weight[a] == 0 || groups_.weight[b] == 0) {
      const std::size_t only = groups_.weight[a] == 0 ? b : a;
      groups_.predicted[g] = groups_.predicted[only];
      if constexpr (Policy::kKnows) {
        groups_.truth[g] = groups_.truth[only];
        groups_.begin[g] = groups_.begin[only];
        groups_.end[g] = groups_.end[only];
      }
      return;
    }
    if constexpr (Policy::kKnows) {
      groups_.begin[g] = groups_.begin[a];
      groups_.end[g] = groups_.end[b];
    }
    for (std::size_t c = 0; c < 3; ++c) {
      groups_.predicted[g][c] = groups_.predicted[a][c] + groups_.predicted[b][c];
      if constexpr (Policy::kKnows) groups_.truth[g][c] = groups_.truth[a][c] + groups_.truth[b][c];
    }
  }

  /// Mean of the cell and of what lies across the three faces that the child touches: the touching child
  /// there if it is decoded already, else the whole cell.
  [[nodiscard]] ColorPoint predict(const ColorLevel& level, std::uint32_t n, std::uint32_t octant) const {
    if (settings_.coarse) return predict_coarse(level, n, octant);
    const FaceNodes& faces = level.faces[n];
    std::int64_t weight = kOwnWeight;
    ColorPoint sum{};
    for (std::size_t c = 0; c < 3; ++c) sum[c] = means_[n][c] * kOwnWeight;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t face = faces[2 * axis + ((octant >> axis) & 1)];
      if (face == kNoNode) continue;
      const ColorNode& other = level.nodes[face];
      const std::uint32_t mirrored = octant ^ (1u << axis);
      const bool touching = face < n && ((other.mask >> mirrored) & 1) != 0;
      const ColorPoint& value =
          touching ? next_[other.child + kOctantRank[other.mask][mirrored] - 1] : means_[face];
      const std::int64_t w = touching ? kChildWeight : kFaceWeight;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += value[c] * w;
      weight += w;
    }
    for (std::size_t c = 0; c < 3; ++c)
      sum[c] = (sum[c] * kReciprocal[static_cast<std::size_t>(weight)]) >> 16;
    return sum;
  }

  /// Across edges too, and the less believed the more it differs from the cell itself: beyond an edge in the
  /// picture colours say nothing of this side.
  [[nodiscard]] ColorPoint predict_coarse(const ColorLevel& level, std::uint32_t n,
                                          std::uint32_t octant) const {
    const ColorPoint& own = means_[n];
    std::int64_t weight = kOwnWeightOfCoarse;
    ColorPoint sum{};
    const auto add = [&](std::uint32_t at, std::uint32_t touching_octant, std::int64_t whole,
                         std::int64_t touching) {
      if (at == kNoNode) return;
      const ColorNode& other = level.nodes[at];
      const bool is_child = at < n && ((other.mask >> touching_octant) & 1) != 0;
      const ColorPoint& value =
          is_child ? next_[other.child + kOctantRank[other.mask][touching_octant] - 1] : means_[at];
      const std::int64_t w = is_child ? touching : whole;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += w * doubted(value[c] - own[c], c);
      weight += w;
    };
    const FaceNodes& faces = level.faces[n];
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      add(faces[2 * axis + ((octant >> axis) & 1)], octant ^ (1u << axis), kFaceWeight, kTouchingFaceWeight);
    }
    for (std::uint32_t pair = 0; pair < 3; ++pair) {
      const auto [u, v] = kEdgeAxes[pair];
      const std::uint32_t side = ((octant >> u) & 1) | (((octant >> v) & 1) << 1);
      add(level.edges[n][4 * pair + side], octant ^ (1u << u) ^ (1u << v), kEdgeWeight, kTouchingEdgeWeight);
    }
    for (std::size_t c = 0; c < 3; ++c)
      sum[c] = own[c] + ((sum[c] * kReciprocal[static_cast<std::size_t>(weight)]) >> 16);
    return sum;
  }
  /// x / (1 + (x / 2 steps)^2), about.
  [[nodiscard]] std::int64_t doubted(std::int64_t x, std::size_t c) const {
    const auto size = static_cast<std::uint64_t>(((x < 0 ? -x : x) * per_doubt_[c]) >> 36);
    return (x * kBelief[std::min<std::uint64_t>(size, kBelief.size() - 1)]) >> 8;
  }

  void set_context(const ColorLevel& level, std::uint32_t n) {
    const FaceNodes& faces = level.faces[n];
    std::uint32_t around = n > 0 ? node_activity_[n - 1] : 0;
    for (std::size_t f = 0; f < 6; f += 2) {
      if (faces[f] != kNoNode) around += node_activity_[faces[f]];
    }
    context_.around = std::min<std::uint32_t>(static_cast<std::uint32_t>(std::bit_width(around)), 5);
    context_.above =
        std::min<std::uint32_t>(static_cast<std::uint32_t>(std::bit_width(std::uint32_t{activity_[n]})), 3);
    if (settings_.coarse) set_coarse_context(level, n, around);
  }

  void set_coarse_context(const ColorLevel& level, std::uint32_t n, std::uint32_t beside) {
    std::uint32_t diagonal = 0, ahead = 0;
    for (const std::uint32_t e : level.edges[n]) {
      if (e == kNoNode) continue;
      (e < n ? diagonal : ahead) += e < n ? node_activity_[e] : activity_[e];
    }
    contrast_ = {};
    for (const std::uint32_t f : level.faces[n]) {
      if (f == kNoNode) continue;
      if (f > n) ahead += 2 * std::uint32_t{activity_[f]};
      for (std::size_t c = 0; c < 3; ++c)
        contrast_[c] = std::max(contrast_[c], std::abs(means_[f][c] - means_[n][c]));
    }
    busy_ = 2 * beside + 3 * std::uint32_t{activity_[n]};
    context_.beside = bit_length(beside, 11);
    context_.handed = bit_length(activity_[n], 8);
    context_.diagonal = bit_length(diagonal, 11);
    context_.ahead = bit_length(ahead, 11);
  }
  [[nodiscard]] static std::uint32_t bit_length(std::uint64_t v, std::uint32_t most) {
    return std::min(static_cast<std::uint32_t>(std::bit_width(v)), most);
  }

  void split_group(std::size_t g) {
    const std::size_t a = 2 * g, b = a + 1;
    const std::int64_t v = groups_.weight[a], w = groups_.weight[b];
    if (v == 0 || w == 0) {
      groups_.mean[v == 0 ? b : a] = groups_.mean[g];
      return;
    }
    ColorPoint predicted, wanted{};
    for (std::size_t c = 0; c < 3; ++c) {
      predicted[c] =
          divide_by_weight(groups_.predicted[b][c], w) - divide_by_weight(groups_.predicted[a][c], v);
      if (settings_.coarse) {
        predicted[c] = std::clamp((predicted[c] * settings_.trust) >> 4, -kMostDifference, kMostDifference);
      }
      if constexpr (Policy::kKnows) {
        wanted[c] = divide_by_weight(groups_.truth[b][c], w) - divide_by_weight(groups_.truth[a][c], v) -
                    predicted[c];
      }
    }
    if constexpr (Policy::kKnows) policy_.enter_split(groups_.begin[a], groups_.begin[b], groups_.end[b]);
    std::tie(groups_.mean[a], groups_.mean[b]) = split(groups_.mean[g], v, w, predicted, wanted, coded_);
  }

  std::pair<ColorPoint, ColorPoint> split(const ColorPoint& m, std::int64_t v, std::int64_t w,
                                          const ColorPoint& predicted, const ColorPoint& wanted, bool coded) {
    ColorPoint d = predicted;
    const auto sv = static_cast<std::size_t>(v), sw = static_cast<std::size_t>(w);
    if (sv >= kSmall || sw >= kSmall) large_ = split_scale(sv, sw);
    const SplitScale& scale = sv < kSmall && sw < kSmall ? small_[sv * kSmall + sw] : large_;
    if (coded) add_coded(d, scale, wanted);
    const std::int64_t share = scale.share;
    std::pair<ColorPoint, ColorPoint> r;
    for (std::size_t c = 0; c < 3; ++c) {
      r.first[c] = m[c] - ((d[c] * share) >> 16);
      r.second[c] = r.first[c] + d[c];
    }
    return r;
  }

  /// What the weights of a split say.
  struct SplitScale {
    std::uint32_t gain;  ///< as in SplitContext
    std::int64_t share;  ///< of the second child in the mean, in 1/65536
    ColorPoint steps;
  };
  [[nodiscard]] SplitScale split_scale(std::uint64_t v, std::uint64_t w) const {
    const std::uint64_t gain = split_gain(v, w);
    const auto root = static_cast<std::int64_t>(split_root(gain));
    SplitScale s;
    s.gain = static_cast<std::uint32_t>(std::clamp(static_cast<int>(std::bit_width(gain)) - 16, 0, 15));
    s.share = static_cast<std::int64_t>((w << 16) / (v + w));
    for (std::size_t c = 0; c < 3; ++c) s.steps[c] = steps_[c] / root + 1;
    return s;
  }

  void add_coded(ColorPoint& d, const SplitScale& scale, const ColorPoint& wanted) {
    context_.gain = scale.gain;
    const ColorPoint& steps = scale.steps;
    if (settings_.coarse) expect(d, steps);
    const std::array<std::int64_t, 3> q = policy_.code(context_, wanted, steps);
    for (std::size_t c = 0; c < 3; ++c) {
      d[c] = std::clamp(d[c] + q[c] * steps[c], -kMostDifference, kMostDifference);
      symbols_ += static_cast<std::uint32_t>(std::min<std::int64_t>(q[c] < 0 ? -q[c] : q[c], 15)) << (c == 0);
    }
  }

  void expect(const ColorPoint& d, const ColorPoint& steps) {
    context_.here = bit_length(symbols_, 7);
    context_.busy = bit_length(busy_ + 4 * symbols_, 11);
    context_.predicted = d;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto size = static_cast<std::uint64_t>(d[c] < 0 ? -d[c] : d[c]);
      const auto step = static_cast<std::uint64_t>(steps[c]);
      context_.expected[c] = bit_length(16 * size / step, 7);
      context_.contrast[c] = bit_length(16 * static_cast<std::uint64_t>(contrast_[c]) / step, 11);
    }
  }

  static constexpr std::size_t kSmall = 16;
  static constexpr std::int64_t kOwnWeight = 4, kFaceWeight = 2, kChildWeight = 3;
  static constexpr std::int64_t kOwnWeightOfCoarse = 8, kTouchingFaceWeight = 4, kEdgeWeight = 1,
                                kTouchingEdgeWeight = 2;
  /// 256 / (1 + (i / 16)^2)
  static constexpr std::array<std::int64_t, 128> kBelief = [] {
    std::array<std::int64_t, 128> t{};
    for (std::size_t i = 0; i < t.size(); ++i) t[i] = static_cast<std::int64_t>(65536 / (256 + i * i));
    return t;
  }();
  static constexpr std::array<std::int64_t, 32> kReciprocal = [] {
    std::array<std::int64_t, 32> r{};
    for (std::size_t i = 1; i < 32; ++i)
      r[i] = (65536 + static_cast<std::int64_t>(i) / 2) / static_cast<std::int64_t>(i);
    return r;
  }();
  /// Beyond any honest difference: damaged symbols must not overflow.
  static constexpr std::int64_t kMostDifference = std::int64_t{1} << 24;

  const ColorTree& tree_;
  const ColorSettings settings_;
  Policy& policy_;
  ColorPoint steps_{};
  ColorPoint per_doubt_{};                           ///< 1/16 of what is half believed, inverse
  std::array<SplitScale, kSmall * kSmall> small_{};  ///< [v][w]
  SplitScale large_{};
  std::vector<ColorPoint> means_, next_;
  std::vector<std::uint8_t> activity_, next_activity_, node_activity_;
  Groups groups_;
  SplitContext context_;
  ColorPoint contrast_{};
  std::uint32_t symbols_ = 0, busy_ = 0;
  bool coded_ = true;
};

}  // namespace mapcodec
