// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/color_encoder.hpp"

#include <map>
#include <optional>
#include <tuple>

#include "mapcodec/attribute/channel_kind.hpp"
#include "mapcodec/attribute/color_symbols.hpp"
#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/base/byte_writer.hpp"

namespace mapcodec {
namespace {

// In 1/256 of a step: below what a difference becomes 0, where all around is still and elsewhere; what is
// added before larger ones are cut. Found by measuring size against error.
constexpr std::int64_t kLoneThreshold = 200, kThreshold = 160, kRounding = 96;
constexpr std::int64_t kMostSymbol = 0xffffff;

/// The original colours: sums over any run of points.
class Originals {
 public:
  Originals(const Channel& values, ColorScale scale) : before_(values.size() + 1) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      const ColorPoint p = to_color_point(load_rgb(values, i), scale);
      for (std::size_t c = 0; c < 3; ++c) before_[i + 1][c] = before_[i][c] + p[c];
    }
  }
  [[nodiscard]] ColorPoint sum(std::uint32_t begin, std::uint32_t end) const {
    ColorPoint s;
    for (std::size_t c = 0; c < 3; ++c) s[c] = before_[end][c] - before_[begin][c];
    return s;
  }
  [[nodiscard]] ColorPoint mean(std::uint32_t begin, std::uint32_t end) const {
    ColorPoint m = sum(begin, end);
    for (std::int64_t& c : m) c /= end - begin;
    return m;
  }

 private:
  std::vector<ColorPoint> before_;
};

/// Quantises; and codes, if there is a writer.
class WritePolicy {
 public:
  static constexpr bool kKnows = true;
  WritePolicy(const ColorTree& tree, const Originals& originals, SymbolWriter* side)
      : tree_(tree), originals_(originals), side_(side) {
    if (side != nullptr) models_ = std::make_unique<ColorModels>();
  }

  void enter(std::size_t level) {
    level_ = &tree_.levels()[level];
    depth_ = static_cast<std::uint32_t>(level);
  }
  [[nodiscard]] ColorPoint sum(std::uint32_t node) const {
    return originals_.sum(level_->nodes[node].begin, level_->nodes[node + 1].begin);
  }
  [[nodiscard]] ColorPoint mean(std::uint32_t begin, std::uint32_t end) const {
    return originals_.mean(begin, end);
  }
  void enter_split(std::uint32_t, std::uint32_t, std::uint32_t) {}
  [[nodiscard]] bool ok() const { return true; }

  std::array<std::int64_t, 3> code(const SplitContext& context, const ColorPoint& wanted,
                                   const ColorPoint& steps) {
    // Where all around is still, a lone one costs more than it mends.
    const std::int64_t threshold = context.around + context.above == 0 ? kLoneThreshold : kThreshold;
    std::array<std::int64_t, 3> q{};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int64_t a = wanted[c] < 0 ? -wanted[c] : wanted[c];
      if (256 * a < threshold * steps[c]) continue;
      const std::int64_t n =
          std::clamp<std::int64_t>((256 * a + kRounding * steps[c]) / (256 * steps[c]), 1, kMostSymbol);
      q[c] = wanted[c] < 0 ? -n : n;
      deepest_ = depth_;
    }
    return side_ != nullptr ? code_split(*side_, *models_, context, q) : q;
  }
  /// Levels whose splits need coding.
  [[nodiscard]] std::uint32_t deepest() const { return deepest_; }

 private:
  const ColorTree& tree_;
  const Originals& originals_;
  SymbolWriter* side_;
  std::unique_ptr<ColorModels> models_;
  const ColorLevel* level_ = nullptr;
  std::uint32_t depth_ = 0, deepest_ = 0;
};

double rgb_distance(const Channel& a, const Channel& b, std::size_t i) {
  const auto x = load_rgb(a, i), y = load_rgb(b, i);
  std::int64_t s = 0;
  for (std::size_t d = 0; d < 3; ++d) s += (x[d] - y[d]) * (x[d] - y[d]);
  return std::sqrt(static_cast<double>(s));
}

}  // namespace

class ColorEncoder::Search {
 public:
  Search(const Channel& values, ColorScale scale, std::span<const VoxelCoord> voxels)
      : values_(values), tree_(voxels, false), originals_(values, scale) {
    settings_.scale = scale;
    ColorPoint m = originals_.mean(0, tree_.points());
    for (std::size_t c = 0; c < 3; ++c) {
      head_[c] = (m[c] + 128) >> 8;
      root_[c] = head_[c] * 256;
    }
  }

  ChannelEncoding run(double bound, Effort effort) {
    const double target = 0.995 * bound;
    const bool split_cells = floor_error() > 0.7 * bound;
    if (split_cells != settings_.split_cells) tries_.clear();
    settings_.split_cells = split_cells;
    settings_.step = search_step(target, effort);
    return finish();
  }

 private:
  /// Error if each finest cell had its mean.
  double floor_error() {
    if (!floor_error_) floor_error_ = measure_floor();
    return *floor_error_;
  }
  double measure_floor() {
    Channel c = values_;
    const ColorLevel& finest = tree_.levels().back();
    for (std::uint32_t n = 0; n < finest.size(); ++n) {
      const ColorPoint m = originals_.mean(finest.nodes[n].begin, finest.nodes[n + 1].begin);
      for (std::uint32_t i = finest.nodes[n].begin; i < finest.nodes[n + 1].begin; ++i)
        store_rgb(c, i, m, settings_.scale);
    }
    return error_of(c);
  }

  [[nodiscard]] double error_of(const Channel& decoded) const {
    double sum = 0;
    for (std::size_t i = 0; i < values_.size(); ++i) sum += rgb_distance(values_, decoded, i);
    return sum / static_cast<double>(values_.size()) / (settings_.scale == ColorScale::sixteen ? 257 : 1);
  }

  /// Codes with the current settings: into `side`, or only to see what comes out.
  Channel code(SymbolWriter* side, std::uint32_t& deepest) {
    WritePolicy policy(tree_, originals_, side);
    ColorWalk<WritePolicy> walk(tree_, settings_, policy);
    const std::vector<ColorPoint> means = walk.run(root_);
    deepest = policy.deepest();
    Channel decoded{values_.info, Bytes(values_.data.size())};
    const ColorLevel& finest = tree_.levels().back();
    const auto store = [&](std::uint32_t i, const ColorPoint& p) {
      store_rgb(decoded, i, p, settings_.scale);
    };
    for (std::uint32_t n = 0; n < finest.size(); ++n) {
      const std::uint32_t begin = finest.nodes[n].begin, end = finest.nodes[n + 1].begin;
      if (settings_.split_cells) {
        walk.split_cell(begin, end, means[n], store);
      } else {
        for (std::uint32_t i = begin; i < end; ++i) store(i, means[n]);
      }
    }
    return decoded;
  }

  /// What comes out of a step.
  struct Try {
    double error = 0;
    std::uint32_t deepest = 0;  ///< levels whose splits need coding
  };
  const Try& try_step(std::uint32_t step) {
    const auto [at, added] = tries_.try_emplace(step);
    if (added) {
      settings_.step = step;
      settings_.levels = static_cast<std::uint32_t>(tree_.levels().size());
      at->second.error = error_of(code(nullptr, at->second.deepest));
    }
    return at->second;
  }

  /// The largest step found whose error is at most `target`: the error grows about as a power of the step, so
  /// each try is where the last two say it should be.
  std::uint32_t search_step(double target, Effort effort) {
    const int tries = effort == Effort::fast ? 5 : 8;
    double low = 1, high = 1 << 20, guess = std::clamp(40 * target, 1.0, high);
    double low_error = 0, high_error = 0;
    for (int i = 0; i < tries && high - low >= 1; ++i) {
      const double error = try_step(static_cast<std::uint32_t>(guess)).error;
      if (error <= target) {
        low = guess, low_error = error;
        if (error > 0.992 * target) break;
      } else {
        high = guess, high_error = error;
      }
      guess = std::clamp(next_guess(low, low_error, high, high_error, 0.996 * target), 1.0, 1048576.0);
      if (static_cast<std::uint32_t>(guess) == static_cast<std::uint32_t>(low)) break;
    }
    return static_cast<std::uint32_t>(low);
  }

  static double next_guess(double low, double low_error, double high, double high_error, double target) {
    if (high_error == 0)
      return low * std::clamp(std::pow(target / std::max(low_error, 1e-3), 1.6), 1.02, 8.0);
    if (low_error == 0) return high * std::clamp(std::pow(target / high_error, 1.6), 0.02, 0.98);
    const double slope = std::log(high / low) / std::log(high_error / low_error);
    const double g = low * std::exp(slope * std::log(target / low_error));
    return std::clamp(g, low + 0.04 * (high - low), high - 0.04 * (high - low));
  }

  ChannelEncoding finish() {
    std::uint32_t deepest = static_cast<std::uint32_t>(tree_.levels().size());
    if (!settings_.split_cells) deepest = try_step(settings_.step).deepest;
    settings_.levels = deepest;
    SymbolWriter side;
    ChannelEncoding e;
    e.decoded = code(&side, deepest);
    e.error = error_of(e.decoded);
    ByteWriter out;
    write_color_head(out, settings_, head_);
    out.raw(side.finish());
    e.bytes = out.take();
    return e;
  }

  const Channel& values_;
  ColorTree tree_;
  Originals originals_;
  ColorSettings settings_;
  ColorPoint head_{}, root_{};
  std::optional<double> floor_error_;
  std::map<std::uint32_t, Try> tries_;  ///< by their step
};

void write_color_head(ByteWriter& out, const ColorSettings& settings, const ColorPoint& root) {
  out.u8(kColorSection);
  out.u8(static_cast<std::uint8_t>((settings.split_cells ? 1 : 0) |
                                   (settings.scale == ColorScale::sixteen ? 2 : 0) |
                                   (settings.coarse ? 8 : 0)));
  out.varint(settings.step);
  out.u8(static_cast<std::uint8_t>(settings.levels));
  for (const std::int64_t c : root) out.signed_varint(c);
  if (settings.coarse) out.u8(settings.trust);
}

ColorScale color_scale_of(const Channel& values) {
  if (values.info.scalar == ScalarType::u8) return ColorScale::eight;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto v = load_rgb(values, i);
    if (std::max({v[0], v[1], v[2]}) > 255) return ColorScale::sixteen;
  }
  return ColorScale::eight;
}

ChannelEncoding encode_color(const Channel& values, double bound, std::span<const VoxelCoord> voxels,
                             Effort effort) {
  return ColorEncoder(values, voxels).encode(bound, effort);
}

ColorEncoder::ColorEncoder(const Channel& values, std::span<const VoxelCoord> voxels)
    : search_(std::make_unique<Search>(values, color_scale_of(values), voxels)) {}

ColorEncoder::~ColorEncoder() = default;

ChannelEncoding ColorEncoder::encode(double bound, Effort effort) {
  return search_->run(bound, effort);
}

}  // namespace mapcodec
