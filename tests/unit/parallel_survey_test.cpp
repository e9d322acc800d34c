// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/survey.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>

#include "parallel/runner.hpp"
#include "parallel/tile_plan.hpp"
#include "parallel_clouds.hpp"

namespace mapcodec {
namespace {

using test::BlockSource;
using test::floor_and_wall;
using test::with_channels;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Result<Survey> look(PointCloud cloud, SurveySettings settings = {}, std::size_t block = 1000) {
  BlockSource source(std::move(cloud), block);
  return survey(source, settings);
}

TilePlan plan(const std::vector<Vec3>& xyz, const TilePlanSettings& settings) {
  const Result<Survey> s = look(with_channels(xyz));
  const Result<TilePlan> p = plan_tiles(*s, settings);
  EXPECT_TRUE(p.ok()) << (p.ok() ? "" : p.error().message);
  return *p;
}

std::vector<VoxelHistogram::Cell> sorted_cells(const VoxelHistogram& h) {
  std::vector<VoxelHistogram::Cell> c = h.cells();
  std::sort(c.begin(), c.end(), [](const auto& a, const auto& b) {
    return std::tie(a.index.x, a.index.y, a.index.z) < std::tie(b.index.x, b.index.y, b.index.z);
  });
  return c;
}

void expect_same(const VoxelHistogram& a, const VoxelHistogram& b) {
  ASSERT_EQ(a.exponent(), b.exponent());
  const auto ca = sorted_cells(a), cb = sorted_cells(b);
  ASSERT_EQ(ca.size(), cb.size());
  for (std::size_t i = 0; i < ca.size(); ++i) {
    EXPECT_EQ(ca[i].index, cb[i].index);
    EXPECT_EQ(ca[i].points, cb[i].points);
  }
}

TEST(VoxelHistogram, CoarsensToTheSameCellsInWhateverOrder) {
  std::vector<Vec3> xyz = floor_and_wall(5000);
  VoxelHistogram whole({0, 0, 0}, -4, 300), backwards({0, 0, 0}, -4, 300), a({0, 0, 0}, -4, 300),
      b({0, 0, 0}, -4, 300);
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    whole.add(xyz[i]);
    backwards.add(xyz[xyz.size() - 1 - i]);
    (i % 3 == 0 ? a : b).add(xyz[i]);
  }
  EXPECT_LE(whole.occupied(), 300u);
  EXPECT_GT(whole.exponent(), -4);
  b.merge(a);
  expect_same(whole, backwards);
  expect_same(whole, b);
  std::uint64_t sum = 0;
  for (const auto& c : whole.cells()) sum += c.points;
  EXPECT_EQ(sum, xyz.size());
}

TEST(VoxelHistogram, AStrayPointDoesNotTakeTheDetail) {
  VoxelHistogram h({0, 0, 0}, -10);
  h.add({0.001, 0, 0});
  h.add({1e6, 0, 0});
  EXPECT_EQ(h.exponent(), -10);
  h.add({-kMaxCoordinate, kMaxCoordinate, 0});
  EXPECT_LE(h.cell_m(), 16);
  EXPECT_EQ(h.occupied(), 3u);
}

TEST(Survey, SeesWhatIsThere) {
  PointCloud cloud = with_channels(floor_and_wall(10000));
  const Box bounds = cloud.bounds();
  cloud.xyz[5000] = {kNan, 0, 0};
  cloud.xyz[5001] = {0, kInfinity, 0};
  cloud.xyz[5002] = {0, 0, 1e300};
  const Result<Survey> s = look(cloud);
  ASSERT_TRUE(s.ok());
  EXPECT_EQ(s->points, 10000u);
  EXPECT_EQ(s->nonfinite, 3u);
  EXPECT_EQ(s->dropped, 7u);
  EXPECT_LE(bounds.min[0], s->bounds.min[0]);
  EXPECT_GE(bounds.max[2], s->bounds.max[2]);
  EXPECT_EQ(s->sample.size(), 9997u);
  EXPECT_EQ(s->warnings.size(), 2u);
  ASSERT_EQ(s->constant_channels.size(), 3u);
  EXPECT_FALSE(s->constant_channels[0]);
  EXPECT_FALSE(s->constant_channels[1]);
  EXPECT_EQ(s->constant_channels[2], (Bytes{5, 0}));
  ASSERT_TRUE(s->cloud);
  EXPECT_TRUE(test::same_bits(*s->cloud, cloud));
  EXPECT_EQ(s->layout.channels.size(), 3u);
  EXPECT_TRUE(s->layout.empty());
}

TEST(Survey, TheLastValueCanEndAConstant) {
  PointCloud cloud = with_channels(floor_and_wall(3000));
  cloud.channels[2].set<std::uint16_t>(2999, 6);
  for (const std::size_t block : {1u, 1000u, 2999u, 5000u})
    EXPECT_FALSE(look(cloud, {}, block)->constant_channels[2]);
}

TEST(Survey, EmptyIsAnError) {
  const Result<Survey> s = look(with_channels({}));
  ASSERT_FALSE(s.ok());
  EXPECT_EQ(s.error().code, ErrorCode::kEmpty);
}

TEST(Survey, OnlyNanIsNoError) {
  const Result<Survey> s = look(with_channels({{kNan, kNan, kNan}, {kNan, 0, 0}}));
  ASSERT_TRUE(s.ok());
  EXPECT_EQ(s->nonfinite, 2u);
  EXPECT_TRUE(s->bounds.empty());
  EXPECT_TRUE(s->sample.empty());
  const Result<TilePlan> p = plan_tiles(*s, {});
  ASSERT_TRUE(p.ok());
  EXPECT_EQ(p->tile_of({kNan, 0, 0}), TileKey::unplaced());
}

TEST(Survey, KeepsTheCloudWithinTheBudgetOnly) {
  const PointCloud cloud = with_channels(floor_and_wall(10000));
  const std::uint64_t bytes = 10000 * (24 + 3 + 8 + 2 + 8);
  SurveySettings settings;
  for (const bool announced : {false, true}) {
    settings.memory_budget_bytes = announced ? 2 * bytes : 6 * bytes;
    BlockSource fits(cloud);
    if (announced) fits.announced = 10000;
    EXPECT_TRUE(survey(fits, settings)->cloud);
    settings.memory_budget_bytes -= 1000;
    BlockSource too_large(cloud);
    if (announced) too_large.announced = 10000;
    EXPECT_FALSE(survey(too_large, settings)->cloud);
  }
  settings.memory_budget_bytes = 0;
  EXPECT_FALSE(look(cloud, settings)->cloud);
  BlockSource lies(cloud);
  lies.announced = std::numeric_limits<std::uint64_t>::max();
  EXPECT_FALSE(survey(lies, {})->cloud);
  lies.announced = 1;
  ASSERT_TRUE(lies.rewind().ok());
  EXPECT_EQ(survey(lies, {})->cloud->size(), 10000u);
}

TEST(Survey, SampleIsEven) {
  std::vector<Vec3> xyz(500000);
  for (std::size_t i = 0; i < xyz.size(); ++i) xyz[i] = {static_cast<double>(i), 0, 0};
  PointCloud cloud;
  cloud.xyz = xyz;
  for (const std::size_t block : {999u, 65536u, 500000u}) {
    const Result<Survey> s = look(cloud, {}, block);
    ASSERT_EQ(s->sample.size(), 125000u);
    for (std::size_t i = 0; i < s->sample.size(); ++i) EXPECT_EQ(s->sample[i][0], static_cast<double>(4 * i));
  }
}

TEST(Survey, SameForAnyNumberOfThreads) {
  const PointCloud cloud = with_channels(floor_and_wall(60000, 2000));
  const Result<Survey> serial = look(cloud);
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    SurveySettings settings;
    settings.arena = &arena;
    const Result<Survey> s = look(cloud, settings);
    ASSERT_TRUE(s.ok());
    expect_same(serial->histogram, s->histogram);
    EXPECT_TRUE(test::same_bits(*serial->cloud, *s->cloud));
    EXPECT_TRUE(test::same_bits(serial->sample, s->sample));
    EXPECT_EQ(serial->constant_channels, s->constant_channels);
    EXPECT_EQ(serial->bounds.min, s->bounds.min);
    EXPECT_EQ(serial->bounds.max, s->bounds.max);
  }
}

TEST(Survey, ErrorsAndStopEndIt) {
  Arena arena(2);
  for (Arena* a : {static_cast<Arena*>(nullptr), &arena}) {
    SurveySettings settings;
    settings.arena = a;
    BlockSource source(with_channels(floor_and_wall(10000)));
    source.fail_at = 5000;
    EXPECT_EQ(survey(source, settings).error().code, ErrorCode::kTruncated);
    std::atomic<bool> stop{false};
    settings.stop = &stop;
    settings.progress = [&](const Progress& p) { stop = p.done >= 3000; };
    EXPECT_EQ(look(with_channels(floor_and_wall(100000)), settings).error().code, ErrorCode::kCancelled);
  }
}

TEST(TilePlan, OneTileForASmallMapAroundZero) {
  const TilePlan p = plan(floor_and_wall(1000), {});
  ASSERT_EQ(p.leaves().size(), 1u);
  EXPECT_EQ(p.leaves()[0].key, (TileKey{0, 0, 0, 0}));
  EXPECT_EQ(p.leaves()[0].points, 1000u);
  EXPECT_EQ(p.tile_size_m(), 64);
}

TEST(TilePlan, OnePointAndAllEqual) {
  for (const std::size_t n : {1u, 5000u}) {
    TilePlanSettings settings;
    settings.target_points = 100;
    const TilePlan p = plan(std::vector<Vec3>(n, Vec3{-0.0, 3, -7.25}), settings);
    ASSERT_EQ(p.leaves().size(), 1u);
    EXPECT_EQ(p.leaves()[0].points, n);
    EXPECT_EQ(p.tile_of({0.0, 3, -7.25}), p.leaves()[0].key);
    EXPECT_FALSE(p.tile_of({5, 3, -7.25}));
  }
}

TEST(TilePlan, TilesAreEvenDisjointAndHoldTheirPoints) {
  for (const Vec3& at : {Vec3{0, 0, 0}, Vec3{1e6, -2e6, 1e3}}) {
    const std::vector<Vec3> xyz = floor_and_wall(100000, 200, at);
    TilePlanSettings settings;
    settings.target_points = 1000;
    const TilePlan p = plan(xyz, settings);
    std::map<TileKey, std::uint64_t, MortonLess> counts;
    for (const Vec3& v : xyz) {
      const std::optional<TileKey> key = p.tile_of(v);
      ASSERT_TRUE(key);
      ++counts[*key];
      EXPECT_TRUE(tile_cube(*key, p.origin(), p.tile_size_m()).contains(v));
    }
    ASSERT_EQ(counts.size(), p.leaves().size());
    EXPECT_GT(counts.size(), 66u);
    EXPECT_LT(counts.size(), 400u);
    std::size_t i = 0;
    bool finest = false;
    for (const auto& [key, n] : counts) {
      EXPECT_EQ(key, p.leaves()[i].key);
      EXPECT_EQ(n, p.leaves()[i].points);
      EXPECT_LE(n, 1500u);
      finest = finest || key.level == 0;
      ++i;
    }
    EXPECT_TRUE(finest);
  }
}

TEST(TilePlan, ANanIsUnplacedAndAStrangerInNoTile) {
  const TilePlan p = plan(floor_and_wall(1000), {});
  EXPECT_EQ(p.tile_of({0, kNan, 0}), TileKey::unplaced());
  EXPECT_EQ(p.tile_of({0, 1e300, 0}), TileKey::unplaced());
  EXPECT_FALSE(p.tile_of({0, 0, 1e6}));
  EXPECT_FALSE(p.tile_of({0, 0, -1e6}));
  EXPECT_FALSE(p.tile_of({kMaxCoordinate, -kMaxCoordinate, 0}));
}

TEST(TilePlan, SideIsLimited) {
  const std::vector<Vec3> xyz = floor_and_wall(1000);
  TilePlanSettings settings;
  settings.max_side_m = 20;
  EXPECT_EQ(plan(xyz, settings).tile_size_m(), 16);
  settings.max_side_m = 1e-3;  // finer than the histogram's cells
  const TilePlan fine = plan(xyz, settings);
  EXPECT_EQ(fine.tile_size_m(), std::ldexp(1.0, -10));
  EXPECT_TRUE(fine.leaves().empty());
  for (const Vec3& v : xyz) EXPECT_TRUE(fine.tile_of(v));
}

TEST(TilePlan, SizeOfTheUser) {
  const std::vector<Vec3> xyz = floor_and_wall(1000, 50, {1e6, 0, 0});
  TilePlanSettings settings;
  settings.tile_size_m = 0.3;
  const TilePlan p = plan(xyz, settings);
  EXPECT_EQ(p.tile_size_m(), 0.3);
  for (const Vec3& v : xyz) {
    const std::optional<TileKey> key = p.tile_of(v);
    ASSERT_TRUE(key);
    EXPECT_EQ(key->level, 0);
    EXPECT_LT(std::abs(key->x), 200);
    const Box cube = tile_cube(*key, p.origin(), 0.3 + 1e-9);
    EXPECT_TRUE(cube.intersects({v, v}));
  }
}

TEST(TilePlan, RefusesBadSizes) {
  const Result<Survey> s = look(with_channels(floor_and_wall(1000)));
  for (const double side : {0.0, -1.0, kNan, kInfinity, 1e-9, 11.0}) {
    TilePlanSettings settings;
    settings.tile_size_m = side;
    settings.max_side_m = 10;
    const Result<TilePlan> p = plan_tiles(*s, settings);
    ASSERT_FALSE(p.ok()) << side;
    EXPECT_EQ(p.error().code, ErrorCode::kInvalidArgument);
  }
  TilePlanSettings none;
  none.target_points = 0;
  EXPECT_FALSE(plan_tiles(*s, none).ok());
}

TEST(TilePlan, FarOutliersDoNotHurt) {
  std::vector<Vec3> xyz = floor_and_wall(20000);
  xyz[77] = {8e9, 0, 0};
  xyz[78] = {-8e9, 8e9, -8e9};
  TilePlanSettings settings;
  settings.target_points = 1000;
  const TilePlan p = plan(xyz, settings);
  for (const Vec3& v : xyz) EXPECT_TRUE(p.tile_of(v));
  settings.max_side_m = 1;
  const Result<Survey> s = look(with_channels(xyz));
  EXPECT_FALSE(plan_tiles(*s, settings).ok());  // 1.6e10 tiles a side
}

TEST(TbbRunner, CoversTheRangeOnce) {
  Arena arena(2);
  TbbRunner runner(arena);
  for (const std::size_t n : {0u, 1u, 7u, 1000u}) {
    std::vector<std::atomic<int>> seen(n);
    runner.run(n, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) ++seen[i];
    });
    for (const auto& s : seen) EXPECT_EQ(s, 1);
  }
}

}  // namespace
}  // namespace mapcodec
