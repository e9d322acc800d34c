// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "mapcodec/codec/octree_decoder.hpp"
#include "mapcodec/codec/octree_encoder.hpp"
#include "mapcodec/geometry/morton.hpp"
#include "mapcodec/geometry/radix_sort.hpp"

namespace mapcodec {
namespace {

TEST(Morton, RoundTripsAndOrdersAxes) {
  EXPECT_EQ(morton_encode({1, 0, 0}), 1u);
  EXPECT_EQ(morton_encode({0, 1, 0}), 2u);
  EXPECT_EQ(morton_encode({0, 0, 1}), 4u);
  EXPECT_EQ(morton_encode({0x1fffff, 0x1fffff, 0x1fffff}), (std::uint64_t{1} << 63) - 1);
  std::mt19937 rng(1);
  for (int i = 0; i < 1000; ++i) {
    VoxelCoord v;
    for (std::uint32_t& x : v) x = static_cast<std::uint32_t>(rng()) & 0x1fffff;
    EXPECT_EQ(morton_decode(morton_encode(v)), v);
  }
}

TEST(RadixSort, EqualsStableSort) {
  std::mt19937_64 rng(2);
  for (const int bits : {0, 1, 7, 11, 12, 33, 63, 64}) {
    for (const std::size_t n : {0u, 1u, 2u, 1000u}) {
      std::vector<KeyedIndex> items(n), scratch;
      for (std::size_t i = 0; i < n; ++i) {
        items[i] = {bits == 0 ? 0 : rng() >> (64 - bits), static_cast<std::uint32_t>(i)};
      }
      auto expected = items;
      std::stable_sort(expected.begin(), expected.end(), [](auto& a, auto& b) { return a.key < b.key; });
      radix_sort(items, scratch, bits);
      for (std::size_t i = 0; i < n; ++i) {
        ASSERT_EQ(items[i].key, expected[i].key);
        ASSERT_EQ(items[i].index, expected[i].index);
      }
    }
  }
}

struct Sample {
  std::vector<std::uint64_t> keys;
  std::vector<std::uint32_t> counts;
  std::uint64_t points = 0;
};

Sample random_sample(std::size_t cells, std::uint32_t depth, std::uint32_t most_count, std::uint32_t seed) {
  std::mt19937_64 rng(seed);
  Sample s;
  for (std::size_t i = 0; i < cells; ++i) s.keys.push_back(depth == 0 ? 0 : rng() >> (64 - 3 * depth));
  std::sort(s.keys.begin(), s.keys.end());
  s.keys.erase(std::unique(s.keys.begin(), s.keys.end()), s.keys.end());
  for (std::size_t i = 0; i < s.keys.size(); ++i) {
    s.counts.push_back(1 + static_cast<std::uint32_t>(rng() % most_count));
    s.points += s.counts.back();
  }
  return s;
}

TEST(Octree, RoundTripsKeysAndCounts) {
  for (const std::uint32_t depth : {0u, 1u, 2u, 3u, 8u, 21u}) {
    for (const std::uint32_t most_count : {1u, 2u, 9u, 70000u}) {
      for (const Effort effort : {Effort::fast, Effort::standard, Effort::high}) {
        const Sample s = random_sample(300, depth, most_count, depth * 10 + most_count);
        const Bytes bytes = encode_octree(s.keys, s.counts, depth, {effort, true});
        const auto decoded = decode_octree(bytes, s.points, depth, {});
        ASSERT_TRUE(decoded.ok()) << decoded.error().to_string() << " depth " << depth;
        EXPECT_EQ(decoded->keys, s.keys);
        EXPECT_EQ(decoded->counts, s.counts);
      }
    }
  }
}

TEST(Octree, CountsOffGivesOnes) {
  const Sample s = random_sample(500, 9, 5, 3);
  const Bytes bytes = encode_octree(s.keys, {}, 9, {Effort::standard, false});
  const auto decoded = decode_octree(bytes, s.keys.size(), 9, {});
  ASSERT_TRUE(decoded.ok());
  EXPECT_EQ(decoded->keys, s.keys);
  EXPECT_EQ(decoded->counts, std::vector<std::uint32_t>(s.keys.size(), 1));
}

TEST(Octree, RefusesDepthsBeyondMortonKeys) {
  const Bytes bytes = encode_octree(std::vector<std::uint64_t>{0}, {}, 0, {});
  EXPECT_TRUE(decode_octree(bytes, 1, 0, {}).ok());
  EXPECT_EQ(decode_octree(bytes, 1, 22, {}).error().code, ErrorCode::kMalformed);
  EXPECT_EQ(decode_octree({}, 1, 3, {}).error().code, ErrorCode::kTruncated);
}

}  // namespace
}  // namespace mapcodec
