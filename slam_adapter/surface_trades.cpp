// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/surface_trades.hpp"

#include <span>

namespace mapcodec {
namespace {

constexpr double kPrices[] = {0.18, 0.25, 0.35, 0.5, 0.7, 1, 1.4, 2};
constexpr double kWeights[] = {0.12, 0.16, 0.22, 0.3, 0.4, 0.5, 0.6};
constexpr std::ptrdiff_t kUsualPrice = 5, kUsualWeight = 3;
constexpr double kBalanced = 0.1;        // directions that differ by less weigh as usual
constexpr double kStepPerPrice = -0.35;  // by how much the logarithm of the step at one error changes

class Climb {
 public:
  Climb(CodingPlan plan, int patience, const TryPlan& attempt)
      : plan_(std::move(plan)), patience_(patience), attempt_(attempt) {}

  Result<CodingPlan> run() {
    MAPCODEC_ASSIGN(best_, attempt_(plan_));
    const bool chosen = plan_.tiles.trade != SurfaceTrade{};
    if (chosen || !plan_.has_surfaces() || plan_.tiles.effort == Effort::fast) return std::move(plan_);
    MAPCODEC_ASSIGN(const bool lower, climb(kPrices, kUsualPrice, -1, &SurfaceTrade::bit_price));
    if (!lower) MAPCODEC_TRY(climb(kPrices, kUsualPrice, 1, &SurfaceTrade::bit_price));
    const double off = best_.forward_to_backward - 1;
    if (std::abs(off) > kBalanced)
      MAPCODEC_TRY(climb(kWeights, kUsualWeight, off > 0 ? 1 : -1, &SurfaceTrade::forward_weight));
    return std::move(plan_);
  }

 private:
  /// @return whether a step that way was worth it.
  Result<bool> climb(std::span<const double> values, std::ptrdiff_t from, std::ptrdiff_t way,
                     double SurfaceTrade::*field) {
    bool moved = false;
    int worse = 0;
    CodingPlan last = plan_;
    for (std::ptrdiff_t i = from + way; i >= 0 && i < std::ssize(values); i += way) {
      CodingPlan trial = last;
      const double value = values[static_cast<std::size_t>(i)];
      if (field == &SurfaceTrade::bit_price)
        trial.step_m *= step_for_price(value / trial.tiles.trade.bit_price);
      trial.tiles.trade.*field = value;
      MAPCODEC_ASSIGN(const Tried tried, attempt_(trial));
      last = trial;
      if (!(tried.cost < best_.cost)) {
        if (++worse == patience_) break;
        continue;
      }
      best_ = tried;
      plan_ = std::move(trial);
      moved = true;
      worse = 0;
    }
    return moved;
  }

  CodingPlan plan_;
  int patience_;
  const TryPlan& attempt_;
  Tried best_;
};

}  // namespace

double step_for_price(double times) {
  return std::pow(times, kStepPerPrice);
}

Result<CodingPlan> find_trade(CodingPlan plan, int patience, const TryPlan& attempt) {
  return Climb(std::move(plan), patience, attempt).run();
}

}  // namespace mapcodec
