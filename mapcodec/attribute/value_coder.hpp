// SPDX-License-Identifier: GPL-3.0-or-later
// The symbols of a "values" section, written or read: for each point in decoded order, for each component,
// its integer in the contexts of the points around it (FORMAT.md 8.3).
#pragma once

#include <algorithm>
#include <memory>

#include "mapcodec/attribute/causal_neighbors.hpp"
#include "mapcodec/attribute/magnitude_model.hpp"
#include "mapcodec/attribute/value_plan.hpp"

namespace mapcodec {

/// Contexts of one component.
struct ValueModels {
  struct Context {
    BitModel zero;
    BitModel sign;
    MagnitudeModel magnitude;  ///< of |residual| - 1
  };
  static constexpr std::size_t kActivities = 18, kFirsts = 6, kRepeats = 4;
  std::array<Context, kActivities * kFirsts> contexts{};
  std::array<BitModel, kRepeats * 3> repeats{};
  std::array<BitModel, 256> names{};
  std::array<BitModel, 3> escape{};
  std::uint64_t last_escape = 0;
  bool escaped = false;
};

/// Half-octave bucket of an activity, 0..17.
[[nodiscard]] inline std::size_t activity_bucket(std::uint64_t a) {
  if (a < 2) return static_cast<std::size_t>(a);
  const auto width = static_cast<std::size_t>(std::bit_width(a));
  return std::min<std::size_t>(2 * width - 2 + ((a >> (width - 2)) & 1), ValueModels::kActivities - 1);
}

template <class Side>
class ValueCoder {
 public:
  using Neighbors = std::span<const CausalNeighbors::Neighbor>;

  /// @param values   u of component c (in coding order) of point i at [i * plans.size() + c].
  /// @param escapes  ordered_bits of values that are not on their lattice, laid out alike; escape_mask says
  /// which.
  ///                 Both empty if no plan has escapes.
  ValueCoder(Side& side, std::span<const ComponentPlan> plans, std::span<const VoxelCoord> voxels,
             std::span<std::uint64_t> values, std::span<std::uint64_t> escapes,
             std::span<std::uint8_t> escape_mask)
      : side_(side),
        plans_(plans),
        voxels_(voxels),
        values_(values),
        escapes_(escapes),
        escape_mask_(escape_mask),
        models_(std::make_unique<ValueModels[]>(plans.size())),
        residuals_(values.size()) {}

  /// False if the code turned out damaged.
  bool run() {
    const bool look_around = std::any_of(plans_.begin(), plans_.end(), [](const ComponentPlan& p) {
      return p.most_coded() > 0 && p.predictor >= Predictor::neighbors;
    });
    CausalNeighbors finder(look_around ? voxels_ : std::span<const VoxelCoord>{});
    for (std::uint32_t i = 0; i < voxels_.size(); ++i) {
      if (!side_.ok() || !code_point(i, look_around ? finder.find(i) : Neighbors{})) return false;
    }
    return side_.ok();
  }

 private:
  bool code_point(std::uint32_t i, Neighbors around) {
    weigh(around);
    std::array<std::int64_t, 3> deviations{};
    std::size_t first = 0;
    for (std::size_t c = 0; c < plans_.size(); ++c) {
      const ComponentPlan& plan = plans_[c];
      std::uint64_t& u = values_[i * plans_.size() + c];
      if (plan.escapes && code_escape(i, c)) {
        u = i > 0 ? values_[(i - 1) * plans_.size() + c] : 0;
        continue;
      }
      if (plan.most_coded() == 0) {
        u = 0;
        continue;
      }
      u = code_value(i, c, around, deviations, first);
      if (u > plan.most_coded()) return false;
    }
    return true;
  }

  /// Nearer neighbours count more: 1 / (squared distance + 1), relative to the nearest.
  void weigh(Neighbors around) {
    for (std::size_t k = 0; k < around.size(); ++k) {
      weights_[k] = k == 0
                        ? kUnitWeight
                        : kUnitWeight * (around[0].squared_distance + 1) / (around[k].squared_distance + 1);
    }
  }

  bool code_escape(std::uint32_t i, std::size_t c) {
    ValueModels& m = models_[c];
    const std::size_t at = i * plans_.size() + c;
    m.escaped = side_.bit(escape_mask_[at] != 0, m.escape[m.escaped]);
    escape_mask_[at] = m.escaped;
    if (!m.escaped) return false;
    if (!side_.bit(escapes_[at] == m.last_escape, m.escape[2])) m.last_escape = side_.raw(escapes_[at], 64);
    escapes_[at] = m.last_escape;
    return true;
  }

  std::uint64_t code_value(std::uint32_t i, std::size_t c, Neighbors around,
                           std::array<std::int64_t, 3>& deviations, std::size_t& first) {
    const ComponentPlan& plan = plans_[c];
    const std::uint64_t u = values_[i * plans_.size() + c];
    switch (plan.predictor) {
      case Predictor::none:
        return side_.raw(u, static_cast<int>(std::bit_width(plan.most_coded())));
      case Predictor::category:
        return code_category(u, c, around);
      case Predictor::previous: {
        const std::uint64_t p = i > 0 ? values_[(i - 1) * plans_.size() + c] : plan.most_coded() / 2;
        return code_residual(i, c, p, i > 0 ? activity_bucket(residuals_[(i - 1) * plans_.size() + c]) : 0,
                             first);
      }
      case Predictor::neighbors:
        break;
    }
    return code_predicted(i, c, around, deviations, first);
  }

  std::uint64_t code_predicted(std::uint32_t i, std::size_t c, Neighbors around,
                               std::array<std::int64_t, 3>& deviations, std::size_t& first) {
    const ComponentPlan& plan = plans_[c];
    const std::uint64_t mean = around.empty() ? plan.most_coded() / 2 : mean_of(c, around);
    std::uint64_t predicted = mean;
    const bool narrow = plan.most_coded() < kNarrow;
    if (narrow) predicted = clamp_cross(plan, mean, deviations);
    const std::uint64_t u = code_residual(i, c, predicted, activity_bucket(activity_of(c, around)), first);
    if (narrow && c < 3) deviations[c] = static_cast<std::int64_t>(u) - static_cast<std::int64_t>(mean);
    return u;
  }

  [[nodiscard]] static std::uint64_t clamp_cross(const ComponentPlan& plan, std::uint64_t mean,
                                                 const std::array<std::int64_t, 3>& deviations) {
    std::int64_t p = static_cast<std::int64_t>(mean) * 16 + 8;
    for (std::size_t k = 0; k < 3; ++k) p += plan.cross[k] * deviations[k];
    p >>= 4;
    return static_cast<std::uint64_t>(
        std::clamp<std::int64_t>(p, 0, static_cast<std::int64_t>(plan.most_coded())));
  }

  /// Weighted mean, as an offset to the nearest neighbour's value; differences too wide to average are left
  /// out.
  [[nodiscard]] std::uint64_t mean_of(std::size_t c, Neighbors around) const {
    const std::uint64_t nearest = values_[around[0].index * plans_.size() + c];
    std::int64_t sum = 0, weight = kUnitWeight;
    for (std::size_t k = 1; k < around.size(); ++k) {
      const auto off = static_cast<std::int64_t>(values_[around[k].index * plans_.size() + c] - nearest);
      if (off >= kWide || off <= -kWide) continue;
      sum += off * static_cast<std::int64_t>(weights_[k]);
      weight += static_cast<std::int64_t>(weights_[k]);
    }
    const std::int64_t half = sum < 0 ? -weight / 2 : weight / 2;
    return nearest + static_cast<std::uint64_t>((sum + half) / weight);
  }

  /// What to expect of |residual|: the mean of the neighbours', twice.
  [[nodiscard]] std::uint64_t activity_of(std::size_t c, Neighbors around) const {
    if (around.empty()) return 0;
    std::uint64_t sum = 0;
    for (const auto& n : around) sum += residuals_[n.index * plans_.size() + c];
    return 2 * sum / around.size();
  }

  std::uint64_t code_residual(std::uint32_t i, std::size_t c, std::uint64_t predicted, std::size_t activity,
                              std::size_t& first) {
    const std::size_t at = i * plans_.size() + c;
    const auto r = static_cast<std::int64_t>(values_[at] - predicted);
    ValueModels::Context& m = models_[c].contexts[activity * ValueModels::kFirsts + first];
    std::uint64_t u = predicted, magnitude = 0;
    if (!side_.bit(r == 0, m.zero)) {
      const bool negative = side_.bit(r < 0, m.sign);
      const std::uint64_t asked =
          (negative ? 0 - static_cast<std::uint64_t>(r) : static_cast<std::uint64_t>(r)) - 1;
      magnitude = m.magnitude.code(side_, asked) + 1;
      u = negative ? predicted - magnitude : predicted + magnitude;
    }
    residuals_[at] = static_cast<std::uint32_t>(std::min<std::uint64_t>(magnitude, kMostResidual));
    first = std::min<std::size_t>(
        std::max<std::size_t>(first, static_cast<std::size_t>(std::bit_width(magnitude))),
        ValueModels::kFirsts - 1);
    return u;
  }

  /// "As the nearest", "as the next that differs from those", or the name bit by bit.
  std::uint64_t code_category(std::uint64_t u, std::size_t c, Neighbors around) {
    ValueModels& m = models_[c];
    std::array<std::uint64_t, 3> seen{};
    std::array<std::size_t, 3> votes{};
    std::size_t count = 0;
    for (const auto& n : around) {
      const std::uint64_t v = values_[n.index * plans_.size() + c];
      const std::uint64_t* const from = seen.data();
      const auto at = static_cast<std::size_t>(std::find(from, from + count, v) - from);
      if (at == count && count < seen.size()) seen[count++] = v;
      if (at < count) ++votes[at];
    }
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t context = std::min<std::size_t>(votes[k], ValueModels::kRepeats) - 1;
      if (side_.bit(u == seen[k], m.repeats[k * ValueModels::kRepeats + context])) return seen[k];
    }
    std::size_t node = 1;
    for (int b = 7; b >= 0; --b) node = node * 2 + side_.bit(((u >> b) & 1) != 0, m.names[node]);
    return node & 255;
  }

  static constexpr std::uint64_t kUnitWeight = 256;
  static constexpr std::int64_t kWide = std::int64_t{1} << 48;
  static constexpr std::uint64_t kMostResidual = 1u << 30;

  Side& side_;
  std::span<const ComponentPlan> plans_;
  std::span<const VoxelCoord> voxels_;
  std::span<std::uint64_t> values_;
  std::span<std::uint64_t> escapes_;
  std::span<std::uint8_t> escape_mask_;
  std::unique_ptr<ValueModels[]> models_;
  std::vector<std::uint32_t> residuals_;
  std::array<std::uint64_t, CausalNeighbors::kMost> weights_{};
};

}  // namespace mapcodec
