// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/multiset_hash.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "tests/unit/quality_support.hpp"

namespace mapcodec {
namespace {

using test::points;
using test::random_cloud;

PointCloud sample() {
  PointCloud cloud = random_cloud(500, 2, {1, 2, 3}, 1);
  Channel time = test::zero_channel("time", ScalarType::f64, 1, cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    time.set<double>(i, 0.001 * static_cast<double>(i));
  }
  cloud.channels.push_back(time);
  return cloud;
}

TEST(MultisetHash, OrderAndBlocksDoNotMatter) {
  const PointCloud cloud = sample();
  std::vector<std::uint32_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0u);
  std::shuffle(order.begin(), order.end(), std::mt19937(7));
  const PointCloud shuffled = cloud.gather(order);
  MultisetHash in_blocks, rest;
  PointCloud block = shuffled.like();
  block.append(shuffled, 0, 123);
  in_blocks.add(block);
  block = shuffled.like();
  block.append(shuffled, 123, 500);
  rest.add(block);
  in_blocks.merge(rest);
  EXPECT_EQ(multiset_hash(cloud), in_blocks);
  EXPECT_EQ(in_blocks.points(), 500u);
}

TEST(MultisetHash, OrderOfChannelsDoesNotMatter) {
  const PointCloud cloud = sample();
  PointCloud other = cloud;
  std::swap(other.channels[0], other.channels[1]);
  EXPECT_EQ(multiset_hash(cloud), multiset_hash(other));
}

TEST(MultisetHash, EveryBitMatters) {
  const PointCloud cloud = sample();
  const MultisetHash expected = multiset_hash(cloud);
  for (std::size_t c = 0; c < cloud.channels.size(); ++c) {
    for (std::size_t byte = 0; byte < 16; ++byte) {
      for (int bit = 0; bit < 8; ++bit) {
        PointCloud other = cloud;
        other.channels[c].data[byte] ^= static_cast<std::uint8_t>(1 << bit);
        EXPECT_FALSE(multiset_hash(other) == expected);
      }
    }
  }
  PointCloud other = cloud;
  other.xyz[3][1] = std::nextafter(static_cast<float>(other.xyz[3][1]), 1e9F);
  EXPECT_FALSE(multiset_hash(other) == expected);
}

TEST(MultisetHash, TwiceIsNotOnce) {
  const MultisetHash one = multiset_hash(points({{1, 2, 3}}));
  const MultisetHash two = multiset_hash(points({{1, 2, 3}, {1, 2, 3}}));
  EXPECT_NE(one.hex(), two.hex());
  EXPECT_NE(two.hex(), multiset_hash({}).hex());
}

TEST(MultisetHash, ValuesDoNotTradePlaces) {
  // The same coordinates and colours, paired otherwise.
  PointCloud a = points({{1, 2, 3}, {4, 5, 6}}), b = a;
  for (PointCloud* c : {&a, &b}) c->channels.push_back(test::zero_channel("intensity", ScalarType::u8, 1, 2));
  a.channels[0].data = {7, 9};
  b.channels[0].data = {9, 7};
  EXPECT_FALSE(multiset_hash(a) == multiset_hash(b));
  EXPECT_FALSE(multiset_hash(points({{1, 2, 3}})) == multiset_hash(points({{2, 1, 3}})));
}

TEST(MultisetHash, CoordinatesAsTheSourceStoresThem) {
  PointCloud fixed = points({{0.1 + 0.2, 1, 2}}), other = points({{0.3, 1, 2}});
  EXPECT_EQ(multiset_hash(fixed), multiset_hash(other));  // the same float32
  for (PointCloud* c : {&fixed, &other})
    c->coordinates = {CoordinateFormat::Kind::fixed, {0.01, 0.01, 0.01}, {0, 0, 0}};
  EXPECT_EQ(multiset_hash(fixed), multiset_hash(other));  // the same integer
  for (PointCloud* c : {&fixed, &other}) c->coordinates.kind = CoordinateFormat::Kind::f64;
  EXPECT_FALSE(multiset_hash(fixed) == multiset_hash(other));
  EXPECT_FALSE(multiset_hash(points({{0.0, 0, 0}})) == multiset_hash(points({{-0.0, 0, 0}})));
}

TEST(MultisetHash, SpreadsOverAllDigits) {
  std::set<std::string> seen;
  for (int i = 0; i < 2000; ++i) seen.insert(multiset_hash(points({{0.001 * i, 0, 0}})).hex().substr(0, 8));
  EXPECT_GT(seen.size(), 1995u);
}

TEST(MultisetHash, NonFinitePointsCountToo) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(multiset_hash(points({{nan, 0, 0}, {1, 1, 1}})), multiset_hash(points({{1, 1, 1}, {nan, 0, 0}})));
}

}  // namespace
}  // namespace mapcodec
