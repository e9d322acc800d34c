// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/coarse_color.hpp"

#include <cmath>

#include "mapcodec/attribute/color_encoder.hpp"
#include "mapcodec/attribute/color_symbols.hpp"
#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/entropy/cost_meter.hpp"

namespace mapcodec {
namespace {

using Symbols = std::array<std::int64_t, 3>;

constexpr std::int64_t kMostSymbol = 0xffffff;
constexpr double kLevel = 1 << kColorFraction;
/// Squared lengths of R + G + B, R - B, R - 2 G + B.
constexpr std::array<double, 3> kLength2{3, 2, 6};

/// Sums of aims and weights over any run of points.
class AimSums {
 public:
  explicit AimSums(const ColorAims& aims) : colors_(aims.rgb.size() + 1), weights_(aims.rgb.size() + 1) {
    for (std::size_t i = 0; i < aims.rgb.size(); ++i) {
      std::array<std::int64_t, 3> rgb;
      for (std::size_t c = 0; c < 3; ++c)
        rgb[c] = static_cast<std::int64_t>(std::lround(double(aims.rgb[i][c]) * kLevel));
      const ColorPoint p{rgb[0] + rgb[1] + rgb[2], rgb[0] - rgb[2], rgb[0] - 2 * rgb[1] + rgb[2]};
      for (std::size_t c = 0; c < 3; ++c) colors_[i + 1][c] = colors_[i][c] + p[c];
      weights_[i + 1] = weights_[i] + double(aims.weights[i]);
    }
  }
  [[nodiscard]] ColorPoint color(std::uint32_t begin, std::uint32_t end) const {
    ColorPoint s;
    for (std::size_t c = 0; c < 3; ++c) s[c] = colors_[end][c] - colors_[begin][c];
    return s;
  }
  [[nodiscard]] double weight(std::uint32_t begin, std::uint32_t end) const {
    return weights_[end] - weights_[begin];
  }

 private:
  std::vector<ColorPoint> colors_;
  std::vector<double> weights_;
};

/// Chooses and writes the symbols of each split.
class WeighingPolicy {
 public:
  static constexpr bool kKnows = true;
  WeighingPolicy(const ColorTree& tree, const AimSums& aims, double price)
      : tree_(tree), aims_(aims), price_(price), models_(std::make_unique<ColorModels>()) {}

  void enter(std::size_t level) {
    level_ = &tree_.levels()[level];
    depth_ = static_cast<std::uint32_t>(level);
  }
  [[nodiscard]] ColorPoint sum(std::uint32_t node) const {
    return aims_.color(level_->nodes[node].begin, level_->nodes[node + 1].begin);
  }
  [[nodiscard]] ColorPoint mean(std::uint32_t begin, std::uint32_t end) const {
    ColorPoint m = aims_.color(begin, end);
    for (std::int64_t& c : m) c /= end - begin;
    return m;
  }
  void enter_split(std::uint32_t begin, std::uint32_t middle, std::uint32_t end) {
    // The first part moves by the share of the second, and the other way round.
    const double share = double(end - middle) / double(end - begin);
    curvature_ =
        aims_.weight(begin, middle) * share * share + aims_.weight(middle, end) * (1 - share) * (1 - share);
  }
  [[nodiscard]] bool ok() const { return true; }

  Symbols code(const SplitContext& context, const ColorPoint& wanted, const ColorPoint& steps) {
    const Symbols q = choose(context, wanted, steps);
    if (q != Symbols{}) deepest_ = depth_;
    return code_split(side_, *models_, context, q);
  }
  /// Levels whose splits need coding.
  [[nodiscard]] std::uint32_t deepest() const { return deepest_; }
  [[nodiscard]] Bytes finish() { return side_.finish(); }

 private:
  Symbols choose(const SplitContext& context, const ColorPoint& wanted, const ColorPoint& steps) {
    Symbols nearest{};
    for (std::size_t c = 0; c < 3; ++c) {
      const double step = static_cast<double>(steps[c]);
      at_[c] = static_cast<double>(wanted[c]) / step;
      weight_[c] = curvature_ * (step / kLevel) * (step / kLevel) / kLength2[c];
      nearest[c] = std::clamp<std::int64_t>(std::llround(at_[c]), -kMostSymbol, kMostSymbol);
    }
    if (nearest == Symbols{}) return nearest;
    Symbols best{};
    double least = cost(context, best);
    const auto consider = [&](const Symbols& q) {
      const double c = cost(context, q);
      if (c < least) {
        least = c;
        best = q;
      }
      return c;
    };
    descend(nearest, consider);
    for (std::size_t c = 0; c < 3; ++c) {
      Symbols alone{};
      alone[c] = nearest[c];
      if (nearest[c] != 0 && alone != nearest) consider(alone);
    }
    return best;
  }

  /// From the nearest symbols towards zero, one component at a time, while that is cheaper.
  template <class Consider>
  static void descend(Symbols q, Consider&& consider) {
    double here = consider(q);
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t c = 0; c < 3; ++c) {
        if (q[c] == 0) continue;
        Symbols next = q;
        next[c] += q[c] > 0 ? -1 : 1;
        const double there = consider(next);
        if (there >= here) continue;
        here = there;
        q = next;
        moved = true;
      }
    }
  }

  [[nodiscard]] double cost(const SplitContext& context, const Symbols& q) {
    CostMeter meter;
    code_split(meter, *models_, context, q);
    double sum = price_ * meter.bits();
    for (std::size_t c = 0; c < 3; ++c) {
      const double off = at_[c] - static_cast<double>(q[c]);
      sum += weight_[c] * off * off;
    }
    return sum;
  }

  const ColorTree& tree_;
  const AimSums& aims_;
  double price_;
  SymbolWriter side_;
  std::unique_ptr<ColorModels> models_;
  const ColorLevel* level_ = nullptr;
  std::uint32_t depth_ = 0, deepest_ = 0;
  double curvature_ = 0;
  std::array<double, 3> at_{}, weight_{};
};

}  // namespace

struct CoarseColorEncoder::State {
  ChannelInfo info;
  ColorSettings settings;
  ColorTree tree;

  State(std::span<const VoxelCoord> voxels, const ChannelInfo& channel, ColorScale scale)
      : info(channel), tree(voxels) {
    settings.scale = scale;
    settings.coarse = true;
  }

  /// @return the levels that have symbols.
  std::uint32_t code(const AimSums& aims, double price, std::uint32_t levels, ChannelEncoding& e) {
    settings.levels = levels;
    WeighingPolicy policy(tree, aims, price);
    ColorWalk<WeighingPolicy> walk(tree, settings, policy);
    ColorPoint head = policy.mean(0, tree.points()), root;
    for (std::size_t c = 0; c < 3; ++c) {
      head[c] = (head[c] + 128) >> 8;
      root[c] = head[c] * 256;
    }
    const std::vector<ColorPoint> means = walk.run(root);
    e.decoded = {info, Bytes(tree.points() * info.stride())};
    const ColorLevel& finest = tree.levels().back();
    for (std::uint32_t n = 0; n < finest.size(); ++n) {
      for (std::uint32_t i = finest.nodes[n].begin; i < finest.nodes[n + 1].begin; ++i)
        store_rgb(e.decoded, i, means[n], settings.scale);
    }
    ByteWriter out;
    write_color_head(out, settings, head);
    out.raw(policy.finish());
    e.bytes = out.take();
    return policy.deepest();
  }
};

CoarseColorEncoder::CoarseColorEncoder(std::span<const VoxelCoord> voxels, const ChannelInfo& info,
                                       ColorScale scale)
    : state_(std::make_unique<State>(voxels, info, scale)) {}

CoarseColorEncoder::~CoarseColorEncoder() = default;

ChannelEncoding CoarseColorEncoder::encode(const ColorAims& aims, std::uint32_t step, double price) {
  ChannelEncoding e;
  const AimSums sums(aims);
  state_->settings.step = step;
  const auto levels = static_cast<std::uint32_t>(state_->tree.levels().size());
  const std::uint32_t needed = state_->code(sums, price, levels, e);
  // Levels without symbols are told in the head, not one split at a time.
  if (needed + 1 < levels) state_->code(sums, price, needed, e);
  return e;
}

}  // namespace mapcodec
