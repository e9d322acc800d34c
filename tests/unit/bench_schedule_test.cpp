// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/schedule.hpp"

#include <gtest/gtest.h>

namespace mapcodec::bench {
namespace {

TEST(Schedule, NothingToDo) {
  EXPECT_EQ(makespan({}, 4), 0);
  EXPECT_EQ(makespan({1, {}, 0, 2, 4}, 4), 3);
}

TEST(Schedule, OneCoreDoesOneAfterTheOther) {
  const TaskGraph g{1, {2, 3, 4}, 0, 0.5, 4};
  EXPECT_DOUBLE_EQ(makespan(g, 1), 10.5);
  EXPECT_DOUBLE_EQ(makespan(g, 0), 10.5);
}

TEST(Schedule, EqualTilesShareTheCores) {
  const TaskGraph g{0, std::vector<double>(64, 1.0), 0, 0, 4};
  EXPECT_DOUBLE_EQ(makespan(g, 8), 8);
  EXPECT_DOUBLE_EQ(makespan(g, 64), 1);
  EXPECT_DOUBLE_EQ(makespan(g, 1000), 1);
}

TEST(Schedule, TheLongestTileIsALowerBound) {
  const TaskGraph g{0, {1, 1, 10, 1, 1}, 0, 0, 4};
  EXPECT_DOUBLE_EQ(makespan(g, 64), 10);
}

TEST(Schedule, ASlowTileHoldsUpTheWindow) {
  // Two cores, one tile each in flight: the third tile waits until the slow first one is handed on.
  const TaskGraph g{0, {10, 1, 1}, 0, 0, 1};
  EXPECT_DOUBLE_EQ(makespan(g, 2), 11);
}

TEST(Schedule, HandingOnIsSerial) {
  const TaskGraph g{0, std::vector<double>(10, 0.0), 1, 0, 100};
  EXPECT_DOUBLE_EQ(makespan(g, 64), 10);
  EXPECT_DOUBLE_EQ(serial_seconds(g), 10);
}

TEST(Schedule, MoreCoresAreNeverSlower) {
  TaskGraph g{0.1, {}, 0.001, 0.1, 4};
  for (int i = 0; i < 200; ++i) g.tile_s.push_back(0.01 * (i * 37 % 11 + 1));
  double last = makespan(g, 1);
  for (std::size_t cores = 2; cores <= 64; cores *= 2) {
    const double now = makespan(g, cores);
    EXPECT_LE(now, last);
    last = now;
  }
}

}  // namespace
}  // namespace mapcodec::bench
