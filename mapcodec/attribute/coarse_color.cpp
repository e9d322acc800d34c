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

constexpr std::int64_t kMostSymbol = 0xffffff;
constexpr double kLevel = 1 << kColorFraction;
/// Squared lengths of R + G + B, R - B, R - 2 G + B.
constexpr std::array<double, 3> kLength2{3, 2, 6};
/// Added to squared deviations [steps^2] where the best trust is sought: large ones cost bits by their
/// logarithm, so they count little more than small ones.
constexpr double kUsualDeviation2 = 0.1;

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
      : tree_(tree),
        aims_(aims),
        price_(price),
        models_(std::make_unique<CoarseColorModels>()),
        begins_run_(tree.points() + 1) {
    begins_run_.front() = begins_run_.back() = true;
  }

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
    ends_ = {begin, middle, end};
    curvature_ =
        aims_.weight(begin, middle) * share * share + aims_.weight(middle, end) * (1 - share) * (1 - share);
  }
  [[nodiscard]] bool ok() const { return true; }

  ColorSymbols code(const SplitContext& context, const ColorPoint& wanted, const ColorPoint& steps) {
    const ColorSymbols q = choose(context, wanted, steps);
    if (q != ColorSymbols{}) {
      deepest_ = depth_;
      for (const std::uint32_t e : ends_) begins_run_[e] = true;
    }
    learn_trust(context, wanted);
    return code_split(side_, *models_, context, q);
  }
  /// Levels whose splits need coding.
  [[nodiscard]] std::uint32_t deepest() const { return deepest_; }
  [[nodiscard]] Bytes finish() { return side_.finish(); }
  [[nodiscard]] std::vector<std::uint32_t> runs() const {
    std::vector<std::uint32_t> r;
    for (std::uint32_t i = 0; i < begins_run_.size(); ++i) {
      if (begins_run_[i]) r.push_back(i);
    }
    return r;
  }
  /// By how much predicted differences should have been multiplied.
  [[nodiscard]] double trust() const { return square_ > 0 ? product_ / square_ : 1; }

 private:
  /// Least squares of the true differences by the predicted ones, each weighed by what it costs in bits.
  void learn_trust(const SplitContext& context, const ColorPoint& wanted) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double predicted = static_cast<double>(context.predicted[c]);
      const double off = static_cast<double>(wanted[c]);
      const double weight = curvature_ / kLength2[c] / (kUsualDeviation2 + at_[c] * at_[c]);
      product_ += weight * predicted * (predicted + off);
      square_ += weight * predicted * predicted;
    }
  }

  ColorSymbols choose(const SplitContext& context, const ColorPoint& wanted, const ColorPoint& steps) {
    ColorSymbols nearest{};
    for (std::size_t c = 0; c < 3; ++c) {
      const double step = static_cast<double>(steps[c]);
      at_[c] = static_cast<double>(wanted[c]) / step;
      weight_[c] = curvature_ * (step / kLevel) * (step / kLevel) / kLength2[c];
      nearest[c] = std::clamp<std::int64_t>(std::llround(at_[c]), -kMostSymbol, kMostSymbol);
    }
    if (nearest == ColorSymbols{}) return nearest;
    ColorSymbols best{};
    double least = cost(context, best);
    const auto consider = [&](const ColorSymbols& q) {
      const double c = cost(context, q);
      if (c < least) {
        least = c;
        best = q;
      }
      return c;
    };
    descend(nearest, consider);
    for (std::size_t c = 0; c < 3; ++c) {
      ColorSymbols alone{};
      alone[c] = nearest[c];
      if (nearest[c] != 0 && alone != nearest) consider(alone);
    }
    return best;
  }

  /// From the nearest symbols towards zero, one component at a time, while that is cheaper.
  template <class Consider>
  static void descend(ColorSymbols q, Consider&& consider) {
    double here = consider(q);
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t c = 0; c < 3; ++c) {
        if (q[c] == 0) continue;
        ColorSymbols next = q;
        next[c] += q[c] > 0 ? -1 : 1;
        const double there = consider(next);
        if (there >= here) continue;
        here = there;
        q = next;
        moved = true;
      }
    }
  }

  [[nodiscard]] double cost(const SplitContext& context, const ColorSymbols& q) {
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
  std::unique_ptr<CoarseColorModels> models_;
  std::vector<bool> begins_run_;
  std::array<std::uint32_t, 3> ends_{};  ///< of the split's points
  double product_ = 0, square_ = 0;
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
      : info(channel), tree(voxels, true) {
    settings.scale = scale;
    settings.coarse = true;
  }

  /// @return the levels that have symbols.
  std::uint32_t code(const AimSums& aims, double price, std::uint32_t levels, CoarseColors& e) {
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
    e.runs = policy.runs();
    e.trust = static_cast<std::uint8_t>(
        std::clamp(std::lround(policy.trust() * settings.trust), 1L, long{kMostTrust}));
    return policy.deepest();
  }
};

CoarseColorEncoder::CoarseColorEncoder(std::span<const VoxelCoord> voxels, const ChannelInfo& info,
                                       ColorScale scale)
    : state_(std::make_unique<State>(voxels, info, scale)) {}

CoarseColorEncoder::~CoarseColorEncoder() = default;

CoarseColors CoarseColorEncoder::encode(const ColorAims& aims, std::uint32_t step, double price,
                                        std::uint8_t trust) {
  CoarseColors e;
  const AimSums sums(aims);
  state_->settings.step = step;
  state_->settings.trust = trust;
  const auto levels = static_cast<std::uint32_t>(state_->tree.levels().size());
  const std::uint32_t needed = state_->code(sums, price, levels, e);
  // Levels without symbols are told in the head, not one split at a time.
  if (needed + 1 < levels) state_->code(sums, price, needed, e);
  return e;
}

}  // namespace mapcodec
