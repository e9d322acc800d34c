// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include "slam_adapter/coding_plan.hpp"
#include "slam_adapter/surface_trades.hpp"

namespace mapcodec {
namespace {

CodingPlan surfaces() {
  CodingPlan plan;
  plan.choice = CodecChoice::surface;
  plan.step_m = 0.01;
  return plan;
}

/// Costs least at one price and one weight; remembers what was tried.
struct Valley {
  double price, weight, forward_to_backward = 1;
  std::vector<SurfaceTrade> tried{};

  TryPlan attempt() {
    return [this](CodingPlan& plan) -> Result<Tried> {
      const SurfaceTrade& t = plan.tiles.trade;
      tried.push_back(t);
      return Tried{std::abs(std::log(t.bit_price / price)) + std::abs(std::log(t.forward_weight / weight)),
                   forward_to_backward};
    };
  }
};

TEST(SurfaceTrades, ClimbsToTheCheapestPrice) {
  for (const double price : {0.35, 0.7, 1.0, 1.4}) {
    Valley valley{price, 0.3};
    const auto found = find_trade(surfaces(), 1, valley.attempt());
    ASSERT_TRUE(found.ok());
    EXPECT_DOUBLE_EQ(found->tiles.trade.bit_price, price);
    EXPECT_DOUBLE_EQ(found->tiles.trade.forward_weight, 0.3);
  }
}

TEST(SurfaceTrades, AsksForFewerBitsWithALargerStep) {
  Valley cheap{0.5, 0.3}, dear{1.4, 0.3};
  EXPECT_GT(find_trade(surfaces(), 1, cheap.attempt())->step_m, 0.01);
  EXPECT_LT(find_trade(surfaces(), 1, dear.attempt())->step_m, 0.01);
}

TEST(SurfaceTrades, WeighsTheWorseDirectionMore) {
  Valley backward{1, 0.16, 0.8}, forward{1, 0.5, 1.2}, alike{1, 0.5, 1.05};
  EXPECT_DOUBLE_EQ(find_trade(surfaces(), 1, backward.attempt())->tiles.trade.forward_weight, 0.16);
  EXPECT_DOUBLE_EQ(find_trade(surfaces(), 1, forward.attempt())->tiles.trade.forward_weight, 0.5);
  EXPECT_DOUBLE_EQ(find_trade(surfaces(), 1, alike.attempt())->tiles.trade.forward_weight, 0.3);
}

TEST(SurfaceTrades, PatienceLooksBehindAWorseValue) {
  const auto bumpy = [](CodingPlan& plan) -> Result<Tried> {
    const double price = plan.tiles.trade.bit_price;
    return Tried{price == 0.7 ? 3.0 : price == 0.5 ? 1.0 : 2.0, 1};
  };
  EXPECT_DOUBLE_EQ(find_trade(surfaces(), 1, bumpy)->tiles.trade.bit_price, 1);
  EXPECT_DOUBLE_EQ(find_trade(surfaces(), 2, bumpy)->tiles.trade.bit_price, 0.5);
}

TEST(SurfaceTrades, FastEffortAndPointsTryNothing) {
  CodingPlan fast = surfaces(), points = surfaces();
  fast.tiles.effort = Effort::fast;
  points.choice = CodecChoice::points;
  for (const CodingPlan& plan : {fast, points}) {
    Valley valley{0.5, 0.5, 1.2};
    EXPECT_EQ(find_trade(plan, 2, valley.attempt())->tiles.trade, SurfaceTrade{});
    EXPECT_EQ(valley.tried.size(), 1u);
  }
}

TEST(SurfaceTrades, AChosenTradeStays) {
  CodingPlan plan = surfaces();
  plan.tiles.trade = {0.7, 0.4};
  Valley valley{0.25, 0.5, 1.2};
  EXPECT_EQ(find_trade(plan, 2, valley.attempt())->tiles.trade, (SurfaceTrade{0.7, 0.4}));
  EXPECT_EQ(valley.tried.size(), 1u);
}

TEST(SurfaceTrades, AnErrorEndsTheSearch) {
  const auto failing = [](CodingPlan&) -> Result<Tried> { return make_error(ErrorCode::kCancelled, "stop"); };
  EXPECT_EQ(find_trade(surfaces(), 1, failing).error().code, ErrorCode::kCancelled);
}

TEST(WorthOfDensity, CountsBeyondWhatTheRmsBringsAnyway) {
  EXPECT_EQ(worth_of_density(3, 0.09, 0.005), 0);
  EXPECT_GT(worth_of_density(3, 0.2, 0.005), 0);
  EXPECT_GT(worth_of_density(3, 0.2, 0.005), worth_of_density(3, 0.15, 0.005));
  // Points that lie 10 cm off are in other voxels of 10 cm.
  EXPECT_EQ(worth_of_density(3, 0.8, 0.1), 0);
}

TEST(WorthOfDensity, IsAShareOfSmallCodings) {
  EXPECT_NEAR(worth_of_density(0.02, 0.2, 0.005) / worth_of_density(0.01, 0.2, 0.005), 2, 1e-9);
  EXPECT_LT(worth_of_density(0.02, 0.2, 0.005), 0.02);
  EXPECT_EQ(worth_of_density(3, 0.2, 0.005), worth_of_density(6, 0.2, 0.005));
}

}  // namespace
}  // namespace mapcodec
