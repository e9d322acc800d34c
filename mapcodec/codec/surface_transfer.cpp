// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_transfer.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "mapcodec/attribute/color_encoder.hpp"
#include "mapcodec/attribute/color_space.hpp"

namespace mapcodec {
namespace {

using Rgb = std::array<std::int64_t, 3>;

void store(Channel& c, std::size_t i, const Rgb& sum, std::int64_t count) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::int64_t mean = (sum[k] + count / 2) / count;
    if (c.info.scalar == ScalarType::u16) {
      c.set<std::uint16_t>(i, static_cast<std::uint16_t>(mean), k);
    } else {
      c.at(i)[k] = static_cast<std::uint8_t>(mean);
    }
  }
}

void add(Rgb& sum, const Rgb& v) {
  for (std::size_t k = 0; k < 3; ++k) sum[k] += v[k];
}

double distance(const Rgb& a, const Rgb& b) {
  std::int64_t s = 0;
  for (std::size_t k = 0; k < 3; ++k) s += (a[k] - b[k]) * (a[k] - b[k]);
  return std::sqrt(static_cast<double>(s));
}

Channel gather(const Channel& from, std::span<const std::uint32_t> order) {
  Channel to{from.info, Bytes(order.size() * from.info.stride())};
  for (std::size_t i = 0; i < order.size(); ++i) std::memcpy(to.at(i), from.at(order[i]), from.info.stride());
  return to;
}

/// Undoes gather.
Channel scatter(const Channel& from, std::span<const std::uint32_t> order) {
  Channel to{from.info, Bytes(order.size() * from.info.stride())};
  for (std::size_t i = 0; i < order.size(); ++i) std::memcpy(to.at(order[i]), from.at(i), from.info.stride());
  return to;
}

/// All points of a voxel get their mean colour.
Channel merge_voxels(const Channel& values, std::span<const VoxelCoord> voxels) {
  Channel merged{values.info, Bytes(values.data.size())};
  for (std::size_t begin = 0, end = 0; begin < voxels.size(); begin = end) {
    Rgb sum{};
    for (end = begin; end < voxels.size() && voxels[end] == voxels[begin]; ++end)
      add(sum, load_rgb(values, end));
    for (std::size_t i = begin; i < end; ++i) store(merged, i, sum, static_cast<std::int64_t>(end - begin));
  }
  return merged;
}

/// Colours on voxels of one size.
struct OnVoxels {
  std::uint8_t shift;
  surface::VoxelOrder sorted;
  Channel merged;  ///< in voxel order
  double floor;    ///< measured error of `merged`
};

class ColorControl {
 public:
  ColorControl(const ChannelSchema& channel, const Channel& original, const NearestPair& near,
               const SamePositions& ties, const SurfaceEncoding& encoding, Effort effort, double loss)
      : channel_(channel),
        loss_(loss),
        original_(original),
        near_(near),
        encoding_(encoding),
        effort_(effort),
        ties_(ties),
        values_(transfer_color(original, near, ties)) {}

  Result<SurfaceColor> run() {
    const OnVoxels finest = on_voxels(surface::least_voxel_shift(encoding_.header.depth));
    const double bound = loss_ > 0 ? (loss_ + std::hypot(loss_, 2 * finest.floor)) / 2
                                   : std::max(channel_.bound, kAboveFloor * finest.floor);
    const OnVoxels coarse = coarsest(bound * kFloorShare, finest);
    MAPCODEC_ASSIGN(SurfaceColor best, encode(coarse, bound));
    if (effort_ == Effort::fast) return best;
    // Rough colours leave more to code on coarse voxels than those save.
    for (std::uint8_t shift = coarse.shift; shift > finest.shift;) {
      MAPCODEC_ASSIGN(SurfaceColor finer, encode(on_voxels(--shift), bound));
      if (!is_better(finer, best, bound)) break;
      best = std::move(finer);
    }
    return best;
  }

 private:
  // What is left of the bound for coding when voxels are as coarse as they may be; found by measuring sizes.
  static constexpr double kFloorShare = 0.95, kAboveFloor = 1.05;
  static constexpr int kTries = 4;

  static bool is_better(const SurfaceColor& a, const SurfaceColor& b, double bound) {
    if ((a.error <= bound) != (b.error <= bound)) return a.error <= bound;
    return a.error <= bound ? a.bytes.size() < b.bytes.size() : a.error < b.error;
  }

  [[nodiscard]] OnVoxels on_voxels(std::uint8_t shift) const {
    OnVoxels r{shift, surface::order_by_voxels(encoding_.points, encoding_.header.depth, shift), {}, 0};
    r.merged = merge_voxels(gather(values_, r.sorted.order), r.sorted.voxels);
    r.floor = color_error_between(original_, scatter(r.merged, r.sorted.order), near_, ties_);
    return r;
  }

  /// The coarsest voxels whose floor is at most `most`, by bisection; or the finest.
  OnVoxels coarsest(double most, const OnVoxels& finest) const {
    OnVoxels best = finest;
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

  Result<SurfaceColor> encode(const OnVoxels& on, double bound) const {
    // The loss of merging and that of coding add up about as independent errors do.
    const double share = on.floor / bound;
    double target = bound * std::max(0.1, std::sqrt(std::max(0.0, 1 - share * share)));
    ColorEncoder encoder(on.merged, on.sorted.voxels);
    std::optional<SurfaceColor> best;
    for (int i = 0; i < kTries; ++i) {
      ChannelEncoding e = encoder.encode(target, effort_);
      const double error = color_error_between(original_, scatter(e.decoded, on.sorted.order), near_, ties_);
      SurfaceColor found{std::move(e.bytes), on.shift, error};
      if (!best || is_better(found, *best, bound)) best = std::move(found);
      if (error <= bound && error > 0.98 * bound) break;
      const double over = error * error - on.floor * on.floor,
                   wanted = 0.98 * bound * bound - on.floor * on.floor;
      target *= over > 0 && wanted > 0 ? std::clamp(std::sqrt(wanted / over), 0.3, 2.0) : 0.5;
    }
    return std::move(*best);
  }

  const ChannelSchema& channel_;
  const double loss_;
  const Channel& original_;
  const NearestPair& near_;
  const SurfaceEncoding& encoding_;
  Effort effort_;
  const SamePositions& ties_;
  Channel values_;
};

}  // namespace

Channel transfer_color(const Channel& original, const NearestPair& near, const SamePositions& ties) {
  const std::size_t n = near.back.index.size();
  std::vector<Rgb> sums(n, Rgb{});
  std::vector<std::uint32_t> counts(n);
  for (std::size_t i = 0; i < near.forth.index.size(); ++i) {
    add(sums[near.forth.index[i]], load_rgb(original, i));
    ++counts[near.forth.index[i]];
  }
  Channel r{original.info, Bytes(n * original.info.stride())};
  for (std::size_t i = 0; i < n; ++i) {
    if (counts[i] == 0) {
      const std::span<const std::uint32_t> same = ties.of(near.back.index[i]);
      Rgb sum{};
      for (const std::uint32_t j : same) add(sum, load_rgb(original, j));
      store(r, i, sum, static_cast<std::int64_t>(same.size()));
    } else {
      store(r, i, sums[i], counts[i]);
    }
  }
  return r;
}

Channel transfer_values(const Channel& original, const Nearest& back) {
  return gather(original, back.index);
}

SamePositions::SamePositions(std::span<const Vec3> points)
    : order_(points.size()), begin_(points.size()), end_(points.size()) {
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return points[a] != points[b] ? points[a] < points[b] : a < b;
  });
  for (std::uint32_t begin = 0, end = 0; begin < order_.size(); begin = end) {
    while (end < order_.size() && points[order_[end]] == points[order_[begin]]) ++end;
    for (std::uint32_t i = begin; i < end; ++i) {
      begin_[order_[i]] = begin;
      end_[order_[i]] = end;
    }
  }
}

double color_error_between(const Channel& original, const Channel& decoded, const NearestPair& near,
                           const SamePositions& ties) {
  double forth = 0, back = 0;
  for (std::size_t i = 0; i < near.forth.index.size(); ++i) {
    forth += distance(load_rgb(original, i), load_rgb(decoded, near.forth.index[i]));
  }
  for (std::size_t i = 0; i < near.back.index.size(); ++i) {
    // Of originals at one position any may be taken for the nearest: what counts is the mean over them.
    const std::span<const std::uint32_t> same = ties.of(near.back.index[i]);
    double sum = 0;
    for (const std::uint32_t j : same) sum += distance(load_rgb(decoded, i), load_rgb(original, j));
    back += sum / static_cast<double>(same.size());
  }
  const double scale = original.info.scalar == ScalarType::u16 ? 257 : 1;
  return (forth / static_cast<double>(near.forth.index.size()) +
          back / static_cast<double>(near.back.index.size())) /
         (2 * scale);
}

Result<SurfaceColor> encode_surface_color(const ChannelSchema& channel, const Channel& original,
                                          const NearestPair& near, const SamePositions& ties,
                                          const SurfaceEncoding& encoding, Effort effort, double loss) {
  return ColorControl(channel, original, near, ties, encoding, effort, loss).run();
}

}  // namespace mapcodec
