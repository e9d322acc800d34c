// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <map>

#include "parallel/spill_file.hpp"
#include "parallel/tile_set.hpp"
#include "parallel_clouds.hpp"

namespace mapcodec {
namespace {

using test::BlockSource;
using test::floor_and_wall;
using test::same_bits;
using test::with_channels;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Case {
  PointCloud cloud;
  TilePlan plan;
};

Case make_case(std::vector<Vec3> xyz, const TilePlanSettings& settings) {
  PointCloud cloud = with_channels(std::move(xyz));
  BlockSource source(cloud);
  const Result<Survey> s = survey(source, {});
  Result<TilePlan> p = plan_tiles(*s, settings);
  EXPECT_TRUE(p.ok());
  return {std::move(cloud), std::move(p).value()};
}

TilePlanSettings by_target(double points) {
  TilePlanSettings s;
  s.target_points = points;
  return s;
}

TilePlanSettings by_size(double side) {
  TilePlanSettings s;
  s.tile_size_m = side;
  return s;
}

/// What the tiles must be, found point by point.
std::map<TileKey, PointCloud, MortonLess> expected_tiles(const Case& c) {
  std::map<TileKey, PointCloud, MortonLess> tiles;
  for (std::size_t i = 0; i < c.cloud.size(); ++i) {
    const TileKey key = *c.plan.tile_of(c.cloud.xyz[i]);
    tiles.try_emplace(key, c.cloud.like()).first->second.append(c.cloud, i, i + 1);
  }
  return tiles;
}

void expect_tiles(const TileSet& set, const std::map<TileKey, PointCloud, MortonLess>& expected) {
  ASSERT_EQ(set.tiles().size(), expected.size());
  std::size_t i = 0;
  for (const auto& [key, cloud] : expected) {
    EXPECT_EQ(set.tiles()[i].key, key);
    EXPECT_EQ(set.tiles()[i].points, cloud.size());
    const Result<PointCloud> tile = set.load(i);
    ASSERT_TRUE(tile.ok());
    EXPECT_TRUE(same_bits(*tile, cloud));
    ++i;
  }
}

/// In memory and through the file, on one thread and on two.
void check(const Case& c) {
  const auto expected = expected_tiles(c);
  Arena arena(2);
  for (Arena* a : {static_cast<Arena*>(nullptr), &arena}) {
    TileSetSettings settings;
    settings.arena = a;
    const Result<TileSet> memory = build_tiles(c.cloud, c.plan, settings);
    ASSERT_TRUE(memory.ok());
    expect_tiles(*memory, expected);
    EXPECT_EQ(memory->points(), c.cloud.size());
    EXPECT_EQ(memory->spilled_bytes(), 0u);
    settings.memory_budget_bytes = 0;
    BlockSource source(c.cloud);
    const Result<TileSet> spilled = build_tiles(source, c.plan, settings);
    ASSERT_TRUE(spilled.ok()) << spilled.error().message;
    EXPECT_EQ(source.rewinds, 1);
    expect_tiles(*spilled, expected);
    EXPECT_EQ(spilled->points(), c.cloud.size());
  }
}

TEST(TileSet, Adaptive) {
  check(make_case(floor_and_wall(200000), by_target(3000)));
}
TEST(TileSet, SizeOfTheUser) {
  check(make_case(floor_and_wall(200000), by_size(2.5)));
}
TEST(TileSet, OnePoint) {
  check(make_case({{1, 2, 3}}, by_target(100)));
}
TEST(TileSet, AllEqual) {
  check(make_case(std::vector<Vec3>(70000, {1, 2, 3}), by_target(100)));
}
TEST(TileSet, FarFromZero) {
  check(make_case(floor_and_wall(70000, 50, {1e6, 5e6, 100.001}), by_target(1000)));
}

TEST(TileSet, NanAndMinusZeroKeepTheirBits) {
  std::vector<Vec3> xyz = floor_and_wall(5000);
  for (std::size_t i = 0; i < xyz.size(); i += 100) xyz[i] = {-0.0, 0.0, -0.0};
  for (std::size_t i = 1; i < xyz.size(); i += 100)
    xyz[i] = {kNan, -kNan, std::numeric_limits<double>::infinity()};
  xyz[2] = {std::bit_cast<double>(std::uint64_t{0x7ff0000000000001}), 0, 0};
  const Case c = make_case(xyz, by_target(300));
  check(c);
  const Result<TileSet> set = build_tiles(c.cloud, c.plan, {});
  EXPECT_TRUE(set->tiles().back().key.is_unplaced());
  EXPECT_EQ(set->tiles().back().points, 51u);
}

TEST(TileSet, FloatsSpillAsFloats) {
  const Case c = make_case(floor_and_wall(100000), by_target(3000));
  TileSetSettings settings;
  settings.memory_budget_bytes = 0;
  BlockSource source(c.cloud);
  const Result<TileSet> set = build_tiles(source, c.plan, settings);
  EXPECT_EQ(set->spilled_bytes(), 100000u * (12 + 3 + 8 + 2));
}

TEST(TileSet, ProgressEndsAtTheTotal) {
  const Case c = make_case(floor_and_wall(10000), by_target(3000));
  Progress last;
  TileSetSettings settings;
  settings.progress = [&](const Progress& p) { last = p; };
  ASSERT_TRUE(build_tiles(c.cloud, c.plan, settings).ok());
  EXPECT_EQ(last.done, 10000u);
  last = {};
  BlockSource source(c.cloud);
  ASSERT_TRUE(build_tiles(source, c.plan, settings).ok());
  EXPECT_EQ(last.done, 10000u);
  EXPECT_EQ(last.total, 10000u);
}

TEST(TileSet, ASourceThatChangesIsAnError) {
  const Case c = make_case(floor_and_wall(10000), by_target(3000));
  const std::vector<std::function<void(PointCloud&)>> changes = {
      [](PointCloud& cloud) {
        cloud.xyz[9999] = {1e6, 0, 0};
      },
      [](PointCloud& cloud) { cloud.resize(9999); },
      [](PointCloud& cloud) { cloud.append(PointCloud(cloud), 0, 1); },
  };
  for (const auto& change : changes) {
    BlockSource source(c.cloud);
    source.on_rewind = change;
    const Result<TileSet> set = build_tiles(source, c.plan, {});
    ASSERT_FALSE(set.ok());
    EXPECT_EQ(set.error().code, ErrorCode::kMalformed);
  }
  PointCloud other = c.cloud;
  other.xyz[0] = {1e6, 0, 0};
  EXPECT_FALSE(build_tiles(other, c.plan, {}).ok());
}

TEST(TileSet, ErrorsAndStopEndIt) {
  const Case c = make_case(floor_and_wall(10000), by_target(3000));
  BlockSource fails(c.cloud);
  fails.fail_at = 5000;
  EXPECT_EQ(build_tiles(fails, c.plan, {}).error().code, ErrorCode::kTruncated);
  std::atomic<bool> stop{true};
  TileSetSettings settings;
  settings.stop = &stop;
  BlockSource source(c.cloud);
  EXPECT_EQ(build_tiles(source, c.plan, settings).error().code, ErrorCode::kCancelled);
  EXPECT_EQ(build_tiles(c.cloud, c.plan, settings).error().code, ErrorCode::kCancelled);
}

TEST(TileSet, NamesTheFolderItCannotWriteTo) {
  const Case c = make_case(floor_and_wall(1000), by_target(3000));
  TileSetSettings settings;
  settings.temp_dir = "/no/such/folder";
  BlockSource source(c.cloud);
  const Result<TileSet> set = build_tiles(source, c.plan, settings);
  ASSERT_FALSE(set.ok());
  EXPECT_EQ(set.error().code, ErrorCode::kCannotWrite);
  EXPECT_NE(set.error().message.find("/no/such/folder"), std::string::npos);
}

TEST(TileSet, LeavesNoFileBehind) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "mapcodec_spill_test";
  std::filesystem::create_directories(folder);
  const Case c = make_case(floor_and_wall(1000), by_target(300));
  TileSetSettings settings;
  settings.temp_dir = folder.string();
  BlockSource source(c.cloud);
  const Result<TileSet> set = build_tiles(source, c.plan, settings);
  ASSERT_TRUE(set.ok());
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  EXPECT_TRUE(set->load(0).ok());
  std::filesystem::remove(folder);
}

TEST(SpillFile, ReadsBackAndKnowsItsEnd) {
  Result<SpillFile> file = SpillFile::create("");
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->write(3, Bytes{1, 2, 3}).ok());
  Bytes back(6);
  ASSERT_TRUE(file->read(0, back).ok());
  EXPECT_EQ(back, (Bytes{0, 0, 0, 1, 2, 3}));
  EXPECT_EQ(file->read(1, back).error().code, ErrorCode::kTruncated);
}

}  // namespace
}  // namespace mapcodec
