// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_color.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include "mapcodec/attribute/coarse_color.hpp"
#include "mapcodec/attribute/color_encoder.hpp"

namespace mapcodec {
namespace {

using Rgb = std::array<float, 3>;

// Found by measuring sizes at equal error: what a bit costs, in shares of what a step costs; how near to the
// median distances are all alike; how much of the bound merging points into voxels may take.
constexpr double kPrice = 0.22, kAlike = 0.7, kFloorShare = 0.25, kLeastFloor = 1.03;
constexpr double kAboveLeast = 1.05;
constexpr int kMedianRounds = 6;

float distance(const Rgb& a, const Rgb& b) {
  const float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return std::sqrt(x * x + y * y + z * z);
}

Rgb load_levels(const Channel& c, std::size_t i, ColorScale scale) {
  const auto v = load_rgb(c, i);
  const float unit = scale == ColorScale::sixteen ? 1.0f / 257 : 1.0f;
  return {static_cast<float>(v[0]) * unit, static_cast<float>(v[1]) * unit, static_cast<float>(v[2]) * unit};
}

/// An original colour that a decoded point is compared with.
struct Sample {
  Rgb rgb;
  float weight;
};

/// The comparisons of each decoded point: by the originals whose nearest it is, and by its own nearest
/// original.
class Comparisons {
 public:
  Comparisons(const Channel& original, ColorScale scale, const NearestPair& near, const SamePositions& ties)
      : begin_(near.back.index.size() + 1) {
    const std::size_t n = near.back.index.size();
    for (const std::uint32_t j : near.forth.index) ++begin_[j + 1];
    for (std::size_t j = 0; j < n; ++j)
      begin_[j + 1] += begin_[j] + static_cast<std::uint32_t>(ties.of(near.back.index[j]).size());
    samples_.resize(begin_[n]);
    std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
    const double forth = static_cast<double>(n) / static_cast<double>(near.forth.index.size());
    for (std::size_t i = 0; i < near.forth.index.size(); ++i)
      samples_[next[near.forth.index[i]]++] = {load_levels(original, i, scale), static_cast<float>(forth)};
    for (std::size_t j = 0; j < n; ++j) {
      const auto same = ties.of(near.back.index[j]);
      for (const std::uint32_t i : same)
        samples_[next[j]++] = {load_levels(original, i, scale), 1.0f / static_cast<float>(same.size())};
    }
  }
  [[nodiscard]] std::span<const Sample> of(std::uint32_t j) const {
    return std::span(samples_).subspan(begin_[j], begin_[j + 1] - begin_[j]);
  }

 private:
  std::vector<std::uint32_t> begin_;
  std::vector<Sample> samples_;
};

/// Mean of samples, each weighted by the reciprocal distance to `center`, which is at least `alike`.
Rgb mean_around(std::span<const Sample> samples, const Rgb& center, float alike, float& weight) {
  Rgb sum{};
  weight = 0;
  for (const Sample& s : samples) {
    const float w = s.weight / std::max(alike, distance(s.rgb, center));
    weight += w;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += w * s.rgb[c];
  }
  for (float& c : sum) c /= weight;
  return sum;
}

Rgb median_of(std::span<const Sample> samples) {
  float weight = 0;
  Rgb m = mean_around(samples, {}, 1e6f, weight);
  for (int i = 0; i < kMedianRounds && samples.size() > 1; ++i) m = mean_around(samples, m, 1, weight);
  return m;
}

/// Decoded points on voxels of one size.
struct OnVoxels {
  std::uint8_t shift;
  surface::VoxelOrder sorted;
  std::vector<std::uint32_t> begin;  ///< of each voxel's points in `sorted`, and the end of all
  ColorAims aims;                    ///< medians
  double floor;                      ///< error if these were kept exactly
};

}  // namespace

class SurfaceColorEncoder::Search {
 public:
  Search(Channel original, const NearestPair& near, const SamePositions& ties,
         const SurfaceEncoding& encoding, Effort effort)
      : original_(std::move(original)),
        near_(near),
        ties_(ties),
        encoding_(encoding),
        passes_(effort == Effort::fast       ? 2
                : effort == Effort::standard ? 3
                                             : 4),
        scale_(color_scale_of(original_)),
        comparisons_(original_, scale_, near, ties) {}

  SurfaceColor run(double bound, double slope) {
    if (!on_) finest_ = on_voxels(surface::least_voxel_shift(encoding_.header.depth));
    if (!on_) least_ = finest_->floor;
    if (!(slope > 0)) bound = std::max(bound, kAboveLeast * least_);
    prepare(std::max(kFloorShare * bound, kLeastFloor * least_));
    aims_ = on_->aims;
    first_ = true;
    trust_ = CoarseColorEncoder::kUsualTrust;
    usual_ = std::max(bound, 1.0);
    SurfaceColor best = slope > 0 ? code_at(slope) : code_within(bound);
    best.least_error = least_;
    return best;
  }

 private:
  [[nodiscard]] OnVoxels on_voxels(std::uint8_t shift) const {
    OnVoxels r{shift, surface::order_by_voxels(encoding_.points, encoding_.header.depth, shift), {}, {}, 0};
    const std::vector<VoxelCoord>& voxels = r.sorted.voxels;
    for (std::uint32_t i = 0; i < voxels.size(); ++i) {
      if (i == 0 || voxels[i] != voxels[i - 1]) r.begin.push_back(i);
    }
    r.begin.push_back(static_cast<std::uint32_t>(voxels.size()));
    r.aims.weights.assign(voxels.size(), 1);
    r.aims.rgb.resize(voxels.size());
    for_each_voxel(r, [&](std::uint32_t begin, std::uint32_t end, std::span<const Sample> samples) {
      std::fill(r.aims.rgb.begin() + begin, r.aims.rgb.begin() + end, median_of(samples));
    });
    r.floor = error_of(decoded(r.aims), r);
    return r;
  }

  /// Calls f(begin, end, samples) for each voxel.
  template <class F>
  void for_each_voxel(const OnVoxels& on, F&& f) const {
    std::vector<Sample> samples;
    for (std::size_t v = 0; v + 1 < on.begin.size(); ++v) {
      samples.clear();
      for (std::uint32_t i = on.begin[v]; i < on.begin[v + 1]; ++i) {
        const auto more = comparisons_.of(on.sorted.order[i]);
        samples.insert(samples.end(), more.begin(), more.end());
      }
      f(on.begin[v], on.begin[v + 1], std::span<const Sample>(samples));
    }
  }

  [[nodiscard]] Channel decoded(const ColorAims& aims) const {
    Channel c{original_.info, Bytes(aims.rgb.size() * original_.info.stride())};
    for (std::size_t i = 0; i < aims.rgb.size(); ++i) {
      std::array<std::int64_t, 3> v;
      for (std::size_t d = 0; d < 3; ++d)
        v[d] = static_cast<std::int64_t>(std::lround(double(aims.rgb[i][d]) * (1 << kColorFraction)));
      store_rgb(c, i, {v[0] + v[1] + v[2], v[0] - v[2], v[0] - 2 * v[1] + v[2]}, scale_);
    }
    return c;
  }

  /// @param colors  in the order of the voxels.
  [[nodiscard]] double error_of(const Channel& colors, const OnVoxels& on) const {
    Channel c{colors.info, Bytes(colors.data.size())};
    for (std::size_t i = 0; i < on.sorted.order.size(); ++i)
      std::memcpy(c.at(on.sorted.order[i]), colors.at(i), c.info.stride());
    return color_error_between(original_, c, near_, ties_);
  }

  /// Chooses the voxels, if they are not chosen for `most`.
  void prepare(double most) {
    if (on_ && most == most_) return;
    if (!finest_) finest_ = on_voxels(surface::least_voxel_shift(encoding_.header.depth));
    encoder_.reset();
    on_.emplace(coarsest(most, std::move(*finest_)));
    finest_.reset();
    most_ = most;
    encoder_.emplace(on_->sorted.voxels, original_.info, scale_);
  }

  /// The coarsest voxels whose floor is at most `most`, by bisection; or the finest.
  OnVoxels coarsest(double most, OnVoxels finest) const {
    OnVoxels best = std::move(finest);
    unsigned high = surface::most_voxel_shift(encoding_.header.depth) + 1u;
    while (best.shift + 1u < high) {
      OnVoxels trial = on_voxels(static_cast<std::uint8_t>((best.shift + high) / 2));
      if (trial.floor <= most) {
        best = std::move(trial);
      } else {
        high = trial.shift;
      }
    }
    return best;
  }

  /// One coding, and what it says of the next one's aims and weights.
  SurfaceColor code(double slope) {
    const double step = std::sqrt(slope * usual_);
    // Weights are about two comparisons over the usual distance.
    if (first_) std::fill(aims_.weights.begin(), aims_.weights.end(), static_cast<float>(2 / usual_));
    first_ = false;
    CoarseColors e = encoder_->encode(
        aims_, static_cast<std::uint32_t>(std::clamp(16 * step, 1.0, 1048576.0)), kPrice * slope, trust_);
    trust_ = e.trust;
    SurfaceColor r{std::move(e.bytes), on_->shift, error_of(e.decoded, *on_)};
    learn(e.decoded, static_cast<float>(std::max(1.0, kAlike * r.error)));
    center_runs(e.decoded, e.runs);
    return r;
  }

  void learn(const Channel& decoded, float alike) {
    double sum = 0;
    for_each_voxel(*on_, [&](std::uint32_t begin, std::uint32_t end, std::span<const Sample> samples) {
      float weight = 0;
      const Rgb aim = mean_around(samples, load_levels(decoded, begin, scale_), alike, weight);
      sum += double(weight);
      for (std::uint32_t i = begin; i < end; ++i) {
        aims_.rgb[i] = aim;
        aims_.weights[i] = weight / static_cast<float>(end - begin);
      }
    });
    usual_ = 2 * static_cast<double>(on_->sorted.order.size()) / sum;
  }

  /// A run without symbols gets the plain mean of its aims, but the mean by weights is what it should have:
  /// its aims are moved by the difference.
  void center_runs(const Channel& decoded, std::span<const std::uint32_t> runs) {
    for (std::size_t k = 0; k + 1 < runs.size(); ++k) {
      const std::uint32_t begin = runs[k], end = runs[k + 1];
      double weights = 0;
      std::array<double, 3> weighed{}, plain{};
      for (std::uint32_t i = begin; i < end; ++i) {
        const Rgb there = load_levels(decoded, i, scale_);
        const double weight = aims_.weights[i];
        weights += weight;
        for (std::size_t c = 0; c < 3; ++c) {
          const double off = double(aims_.rgb[i][c]) - double(there[c]);
          weighed[c] += weight * off;
          plain[c] += off;
        }
      }
      for (std::size_t c = 0; c < 3; ++c) {
        const auto move = static_cast<float>(weighed[c] / weights - plain[c] / double(end - begin));
        for (std::uint32_t i = begin; i < end; ++i) aims_.rgb[i][c] += move;
      }
    }
  }

  SurfaceColor code_at(double slope) {
    SurfaceColor r = code(slope);
    for (int i = 1; i < passes_; ++i) r = code(slope);
    return r;
  }

  /// Slopes by secants in logarithms until the error is near the bound: bits fall with about its fifth power.
  SurfaceColor code_within(double bound) {
    constexpr int kTries = 9;
    constexpr double kAim = 0.993, kNear = 0.985, kUsualExponent = 0.22;
    const double aim = std::log(kAim * bound);
    double at = std::log(20 * bound), exponent = kUsualExponent, low = -INFINITY, high = INFINITY;
    double last_at = 0, last_error = 0;
    std::optional<SurfaceColor> best;
    for (int i = 0; i < kTries; ++i) {
      SurfaceColor r = code(std::exp(at));
      const double error = std::log(std::max(r.error, 1e-3));
      const bool near = r.error <= bound && r.error >= kNear * bound;
      if (!best || is_better(r, *best, bound)) best = std::move(r);
      if (near && i + 1 >= passes_) break;
      // The first codings still learn what to aim at: their errors say little of the next ones'.
      if (i + 1 >= passes_) (error < aim ? low : high) = at;
      if (i >= passes_ && std::abs(at - last_at) > 0.02)
        exponent = std::clamp((error - last_error) / (at - last_at), 0.05, 0.6);
      last_at = at;
      last_error = error;
      at += std::clamp((aim - error) / exponent, -2.8, 2.8);
      if (std::isfinite(low) && std::isfinite(high) && low < high)
        at = std::clamp(at, low + (high - low) / 8, high - (high - low) / 8);
      at = std::clamp(at, -9.0, 18.0);
    }
    return std::move(*best);
  }

  static bool is_better(const SurfaceColor& a, const SurfaceColor& b, double bound) {
    if ((a.error <= bound) != (b.error <= bound)) return a.error <= bound;
    return a.error <= bound ? a.bytes.size() < b.bytes.size() : a.error < b.error;
  }

  const Channel original_;
  const NearestPair& near_;
  const SamePositions& ties_;
  const SurfaceEncoding& encoding_;
  int passes_;
  ColorScale scale_;
  Comparisons comparisons_;
  std::optional<OnVoxels> finest_, on_;
  double least_ = 0, most_ = 0;  ///< error on the finest voxels; that on_ was chosen for
  std::optional<CoarseColorEncoder> encoder_;
  ColorAims aims_;    ///< of the next coding
  double usual_ = 1;  ///< harmonic mean of the distances
  std::uint8_t trust_ = 0;
  bool first_ = true;
};

SurfaceColorEncoder::SurfaceColorEncoder(Channel original, const NearestPair& near, const SamePositions& ties,
                                         const SurfaceEncoding& encoding, Effort effort)
    : search_(std::make_unique<Search>(std::move(original), near, ties, encoding, effort)) {}

SurfaceColorEncoder::~SurfaceColorEncoder() = default;

SurfaceColor SurfaceColorEncoder::encode(double bound, double slope) {
  return search_->run(bound, slope);
}

}  // namespace mapcodec
