// SPDX-License-Identifier: GPL-3.0-or-later
// The grid's nearest neighbours against the k-d tree's: exactly as near.
#include <gtest/gtest.h>

#include <numeric>

#include "mapcodec/quality/grid_nearest.hpp"
#include "tests/unit/points_support.hpp"

namespace mapcodec::test {
namespace {

void expect_exact(const Cloud& from, const Cloud& to) {
  const NeighborIndex tree(to);
  const NearestPair pair = find_nearest_pair(from, to);
  ASSERT_EQ(pair.forth.index.size(), from.size());
  ASSERT_EQ(pair.back.index.size(), to.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    double expected = 0, found = 0;
    (void)tree.nearest(from[i], expected);
    const Vec3& q = to[pair.forth.index[i]];
    for (std::size_t d = 0; d < 3; ++d) found += (from[i][d] - q[d]) * (from[i][d] - q[d]);
    ASSERT_DOUBLE_EQ(pair.forth.squared[i], expected) << i;
    ASSERT_DOUBLE_EQ(found, expected) << i;
  }
}

Cloud joined(Cloud a, const Cloud& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

TEST(GridNearest, IsExact) {
  const Cloud room_a = room(5000, 2, 1), room_b = room(4000, 2, 2);
  expect_exact(room_a, room_b);
  expect_exact(room_a, room_a);
  expect_exact(sparse(3000, 1, 3), sparse(100, 1, 4));
  expect_exact(sparse(100, 1, 3), sparse(3000, 1, 4));
  expect_exact(moved(room_a, {1e6, 2e6, -1e6}), moved(room_b, {1e6, 2e6, -1e6}));
}

TEST(GridNearest, IsExactFarAway) {
  const Cloud a = room(2000, 2, 1);
  expect_exact(moved(a, {50, 0, 0}), a);
  expect_exact(moved(a, {-3, -3, 0.1}), a);
  // Dense and sparse parts together, and a point far from all.
  const Cloud mixed = joined(joined(room(3000, 0.05, 8), sparse(300, 20, 9)), {{1e5, 1e5, 1e5}});
  expect_exact(mixed, joined(room(2000, 0.05, 10), sparse(200, 30, 11)));
  expect_exact(joined(room(2000, 0.05, 10), sparse(200, 30, 11)), mixed);
}

TEST(GridNearest, EstimatesFromAPartOfThePoints) {
  const Cloud a = room(90000, 2, 1), b = room(70000, 2, 2);
  const NearestPair exact = find_nearest_pair(a, b);
  const RoughErrors rough = estimate_errors(a, b);
  const auto mean = [](const Nearest& n) {
    return std::accumulate(n.squared.begin(), n.squared.end(), 0.0) / double(n.squared.size());
  };
  EXPECT_NEAR(rough.forth / mean(exact.forth), 1, 0.04);
  EXPECT_NEAR(rough.back / mean(exact.back), 1, 0.04);
  // Of few points all are asked.
  const Cloud few(a.begin(), a.begin() + 5000);
  const NearestPair exact_few = find_nearest_pair(few, few);
  EXPECT_DOUBLE_EQ(estimate_errors(few, few).forth, mean(exact_few.forth));
}

TEST(GridNearest, DegenerateClouds) {
  const Cloud one{{1, 2, 3}}, equal(3000, Vec3{0.1, 0.2, 0.3});
  expect_exact(one, one);
  expect_exact(one, equal);
  expect_exact(equal, one);
  expect_exact(joined(equal, room(1000, 1, 1)), joined(equal, sparse(500, 1, 2)));
  Cloud line;
  for (int i = 0; i < 2000; ++i) line.push_back({0.001 * i, 0, 0});
  expect_exact(line, sparse(100, 2, 5));
  expect_exact(sparse(100, 2, 5), line);
}

}  // namespace
}  // namespace mapcodec::test
