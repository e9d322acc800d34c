// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>

#include "slam_adapter/rms_account.hpp"

namespace mapcodec {
namespace {

constexpr double kPromise = 0.02;

MapInfo info_of(double achieved_m, std::uint64_t points) {
  MapInfo info;
  info.achieved.rms_m = achieved_m;
  info.input_points = points;
  return info;
}

RmsAccount::Entry pending(double added) {
  return {added, 0, 0, 0.15 * kPromise, 0.15 * kPromise, true};
}

TEST(RmsAccount, FoldingWhatItAllowsKeepsThePromise) {
  for (const double base : {0.0, 100.0, 1000.0}) {
    for (const double known : {0.0, 500.0}) {
      RmsAccount a(info_of(base > 0 ? 0.99 * kPromise : 0, std::uint64_t(base)), kPromise, base);
      RmsAccount::Entry e = pending(800);
      e.known = known;
      e.known_m2 = known * kPromise * kPromise;
      a.add(e);
      EXPECT_LE(a.excess_m2(0, 0), 0);
      for (int half = 0; half < 2; ++half) a.fold(400, a.folding_rms_m(), a.folding_rms_m());
      EXPECT_LE(a.rms_m(), kPromise) << base << " " << known;
      EXPECT_GE(a.rms_m(), 0.95 * kPromise);
      EXPECT_FALSE(a.extra());
    }
  }
}

TEST(RmsAccount, GoesOnFromItsRecord) {
  RmsAccount a(info_of(0.99 * kPromise, 300), kPromise, 300);
  a.add(pending(700));
  MapInfo info = info_of(a.rms_m(), 1000);
  ASSERT_TRUE(a.extra());
  info.extras[kRmsAccountExtra] = *a.extra();
  const RmsAccount b(info, kPromise, 1000);
  EXPECT_NEAR(b.folding_rms_m(), a.folding_rms_m(), 1e-9);
  EXPECT_EQ(b.extra(), a.extra());
  // Of a map that another writer changed, or damaged, the record is left aside.
  info.achieved.rms_m = 0.5 * kPromise;
  EXPECT_FALSE(RmsAccount(info, kPromise, 1000).extra());
  info.achieved.rms_m = a.rms_m();
  const Bytes whole = *a.extra();
  for (std::size_t n = 0; n < whole.size(); ++n) {
    info.extras[kRmsAccountExtra] = Bytes(whole.begin(), whole.begin() + std::ptrdiff_t(n));
    const RmsAccount c(info, kPromise, 1000);
    EXPECT_TRUE(std::isfinite(c.rms_m()) && c.folding_rms_m() > 0);
  }
}

TEST(RmsAccount, KnownPointsMayNotSpendWhatPendingOnesNeed) {
  RmsAccount a(MapInfo{}, kPromise, 0);
  a.add(pending(1000));
  EXPECT_LE(a.excess_m2(1000, 1000 * kPromise * kPromise), 0);
  EXPECT_GT(a.excess_m2(1000, 1.1 * 1000 * kPromise * kPromise), 0);
}

TEST(RmsAccount, NothingIsCountedWithoutAnRms) {
  RmsAccount a(info_of(0, 10), 0, 10);
  a.add({5, 5, 0, 0, 0, true});
  EXPECT_FALSE(a.extra());
}

}  // namespace
}  // namespace mapcodec
