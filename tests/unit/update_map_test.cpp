// SPDX-License-Identifier: GPL-3.0-or-later
// Maps that are updated, folded, cut and moved while they live.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "mapcodec/cloud/cloud_source.hpp"
#include "mapcodec/quality/evaluation.hpp"
#include "maps/compaction.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/create_map.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/map_updater.hpp"

namespace mapcodec {
namespace {

/// Two walls and a floor of a room as a scanner at (x, 0, 1) sees them, with noise and colours.
PointCloud room(double x, unsigned seed, std::size_t n = 6000) {
  std::mt19937 random(seed);
  const auto uniform = [&](double a, double b) { return a + (b - a) * double(random()) / 4294967296.0; };
  PointCloud c;
  c.channels.push_back({{"rgb", ScalarType::u8, 3}, {}});
  c.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double u = x + uniform(-3, 3), v = uniform(0, 2.5),
                 noise = 0.002 * (uniform(-1, 1) + uniform(-1, 1));
    Vec3& p = c.xyz[i];
    p = i % 3 == 0 ? Vec3{u, uniform(-2, 2), noise} : Vec3{u, (i % 3 == 1 ? -2 : 2) + noise, v};
    for (double& coordinate : p) coordinate = double(float(coordinate));
    for (std::size_t k = 0; k < 3; ++k)
      c.channels[0].set(i, static_cast<std::uint8_t>(128 + 40 * std::sin(u + double(k)) + uniform(-4, 4)), k);
  }
  return c;
}

class Living : public ::testing::TestWithParam<PromiseKind> {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("mapcodec_living_" + std::to_string(::getpid()) + "_" +
               std::to_string(std::hash<std::string>{}(
                   ::testing::UnitTest::GetInstance()->current_test_info()->name())));
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "map.mapc").string();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  CompressOptions options() const {
    CompressOptions o;
    o.promise = GetParam();
    o.promise_m = GetParam() == PromiseKind::lossless ? 0 : 0.02;
    o.color_error = 10;
    o.tile_size_m = 4;
    return o;
  }
  void create() {
    const PointCloud scan = room(0, 1);
    CloudSource first(scan);
    std::vector<std::string> warnings;
    auto map = create_map(path_, first, options(), arena_, {}, warnings);
    ASSERT_TRUE(map.ok()) << map.error().message;
    ASSERT_TRUE(map->insert(room(0, 1)).ok());
    const auto r = map->commit(7);
    ASSERT_TRUE(r.ok()) << r.error().message;
    EXPECT_EQ(r->points_added, 6000u);
  }
  UpdateReport insert(PointCloud cloud, int threads = 2, const UpdateSettings& settings = {}) {
    Arena arena(threads);
    auto map = MapUpdater::open(path_, arena, settings);
    EXPECT_TRUE(map.ok());
    EXPECT_TRUE(map->insert(std::move(cloud)).ok());
    const auto r = map->commit(8);
    EXPECT_TRUE(r.ok());
    return *r;
  }
  void fold() {
    {
      auto map = MapUpdater::open(path_, arena_);
      ASSERT_TRUE(map.ok());
      ASSERT_TRUE(map->fold().ok());
      ASSERT_TRUE(map->commit(9).ok());
    }
    const auto compacted = compact_archive(path_);
    ASSERT_TRUE(compacted.ok()) << compacted.error().message;
  }
  PointCloud all() const {
    auto map = MapFile::open(path_);
    EXPECT_TRUE(map.ok());
    auto cloud = map->read();
    EXPECT_TRUE(cloud.ok());
    return std::move(cloud).value();
  }
  Bytes file() const {
    std::ifstream in(path_, std::ios::binary);
    return Bytes(std::istreambuf_iterator<char>(in), {});
  }

  Arena arena_{2};
  std::filesystem::path folder_;
  std::string path_;
};

TEST_P(Living, FiftyTimesTheSameScanIsOnce) {
  create();
  const Bytes first = file();
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(insert(room(0, 1)).committed);
  EXPECT_EQ(file(), first);
  fold();
  const Bytes folded = file();
  const std::size_t count = all().size();
  for (int i = 0; i < 5; ++i) insert(room(0, 1));
  EXPECT_LE(all().size(), count + count / 50);
  fold();
  const Bytes again = file();
  fold();
  EXPECT_EQ(file(), again);  // folding what is folded changes nothing
  EXPECT_LE(again.size(), folded.size() + folded.size() / 5);
}

TEST_P(Living, PromiseHoldsScanAfterScan) {
  create();
  PointCloud original = room(0, 1);
  for (int i = 1; i <= 4; ++i) {
    insert(room(i, unsigned(i + 1)));
    original.append(room(i, unsigned(i + 1)));
    if (i == 2) fold();
  }
  const auto check = [&] {
    const PointCloud decoded = all();
    SerialRunner runner;
    const auto e = evaluate(original, decoded, runner, {});
    ASSERT_TRUE(e.ok());
    const auto map = MapFile::open(path_);
    if (GetParam() == PromiseKind::lossless) {
      EXPECT_EQ(decoded.size(), original.size());
      EXPECT_EQ(e->rms_m, 0);
    }
    EXPECT_LE(e->rms_m, GetParam() == PromiseKind::max_error ? 0.02 * std::sqrt(3.0) : 0.02);
    if (GetParam() == PromiseKind::rms) {
      EXPECT_LE(map->summary().achieved.rms_m, 0.02 * (1 + 1e-6));
    }
    EXPECT_GE(map->summary().achieved.rms_m * 1.03 + 1e-12, e->rms_m);
    EXPECT_LE(e->color_error, 10 * 1.05);
    EXPECT_EQ(map->archive().info().input_points, original.size());
  };
  check();
  fold();
  check();
}

TEST_P(Living, ScansOfOneCommitAreHeldAgainstEachOther) {
  std::uint64_t added[2] = {0, 0};
  for (const bool together : {false, true}) {
    std::filesystem::remove(path_);
    create();
    auto map = MapUpdater::open(path_, arena_);
    ASSERT_TRUE(map.ok());
    for (int i = 1; i <= 4; ++i) {
      // Half of each scan is known from the one before, and all of it comes twice.
      for (int twice = 0; twice < 2; ++twice) ASSERT_TRUE(map->insert(room(3 * i, unsigned(i / 2))).ok());
      if (together && i < 4) continue;
      const auto r = map->commit(i);
      ASSERT_TRUE(r.ok());
      added[together] += r->points_added;
    }
  }
  EXPECT_GT(added[0], 0u);
  EXPECT_EQ(added[1], added[0]);
}

TEST_P(Living, PointsOfOneScanAreNot) {
  create();
  auto map = MapUpdater::open(path_, arena_);
  ASSERT_TRUE(map.ok());
  const PointCloud far = room(40, 3);
  ASSERT_TRUE(map->insert(far, 0, MapUpdater::ScanEnd::later).ok());
  ASSERT_TRUE(map->insert(far, 0, MapUpdater::ScanEnd::later).ok());
  map->end_scan();
  const auto r = map->commit(1);
  ASSERT_TRUE(r.ok());
  EXPECT_EQ(r->points_added, 2 * far.size());
}

/// What an RMS promise alone has: an account.
class LivingByRms : public Living {};
INSTANTIATE_TEST_SUITE_P(Promises, LivingByRms, ::testing::Values(PromiseKind::rms),
                         [](const auto&) { return std::string("rms"); });

TEST_P(LivingByRms, AMapBegunAsACompressedScanKeepsItsRecord) {
  PointCloud original = room(0, 1, 20000);
  CompressOptions o = options();
  o.promise_m = 0.03;
  o.overwrite = true;
  {
    CloudSource first(original);
    ASSERT_TRUE(compress(first, path_, o).ok());
  }
  const auto check = [&] {
    SerialRunner runner;
    const auto e = evaluate(original, all(), runner, {});
    ASSERT_TRUE(e.ok());
    const double recorded = MapFile::open(path_)->summary().achieved.rms_m;
    EXPECT_LE(recorded, 0.03 * (1 + 1e-6));
    EXPECT_LE(e->rms_m, 0.03);
    EXPECT_GE(1.03 * recorded, e->rms_m);
  };
  for (int i = 1; i <= 5; ++i) {
    insert(room(0.7 * i, unsigned(i + 1), 20000));
    original.append(room(0.7 * i, unsigned(i + 1), 20000));
    if (i == 2) fold();
    check();
  }
  fold();
  check();
}

/// How far the decoded points of the map's tiles reach beyond the plane x = `border` [m], from the left and
/// from the right.
std::pair<double, double> overlap(const std::string& path, double border) {
  const auto map = MapFile::open(path);
  EXPECT_TRUE(map.ok());
  std::pair<double, double> reach{-1, -1};
  for (std::size_t i = 0; i < map->archive().tiles().size(); ++i) {
    const TileRecord& tile = map->archive().tiles()[i];
    EXPECT_EQ(tile.codec, static_cast<std::uint8_t>(CodecId::surface));
    const Box cube = tile_cube(tile.key, map->schema().origin, map->schema().tile_size_m);
    const bool left = cube.max[0] < border + 0.1;
    const PointCloud cloud = map->read_tile(i).value();
    for (const Vec3& q : cloud.xyz) {
      double& far = left ? reach.first : reach.second;
      far = std::max(far, left ? q[0] - border : border - q[0]);
    }
  }
  return reach;
}

TEST_P(LivingByRms, SurfacesOfFoldedTilesGoOnWhereTilesLieBesideThem) {
  std::mt19937 random(3);
  const auto uniform = [&](double a, double b) { return a + (b - a) * double(random()) / 4294967296.0; };
  PointCloud both;
  for (int i = 0; i < 80000; ++i)
    both.xyz.push_back({uniform(0.1, 7.9), uniform(0.1, 3.9), uniform(1, 1.005)});
  CompressOptions o = options();
  o.promise_m = 0.03;
  const auto build = [&](const std::vector<PointCloud>& scans, int threads) {
    std::filesystem::remove(path_);
    Arena arena(threads);
    CloudSource first(both);
    std::vector<std::string> warnings;
    auto map = create_map(path_, first, o, arena, {}, warnings);
    ASSERT_TRUE(map.ok()) << map.error().message;
    for (const PointCloud& scan : scans) {
      ASSERT_TRUE(map->insert(scan).ok());
      ASSERT_TRUE(map->fold().ok());
    }
    ASSERT_TRUE(map->commit(7).ok());
  };
  build({both}, 2);
  const MapSchema schema = MapFile::open(path_)->schema();
  const double border =
      schema.origin[0] + schema.tile_size_m * std::round((4 - schema.origin[0]) / schema.tile_size_m);
  const auto bytes = file();
  const auto at_once = overlap(path_, border);
  EXPECT_GT(at_once.first, 0.001);
  EXPECT_GT(at_once.second, 0.001);
  build({both}, 1);
  EXPECT_EQ(file(), bytes);
  // What was coded for good before its neighbour came stays as it is; what comes goes on into it.
  PointCloud left, right;
  for (const Vec3& p : both.xyz) (p[0] < border ? left : right).xyz.push_back(p);
  build({left, right}, 2);
  const auto later = overlap(path_, border);
  EXPECT_LT(later.first, at_once.first);
  EXPECT_GT(later.second, 0.001);
}

TEST_P(Living, SameBytesOnAnyNumberOfThreads) {
  Bytes bytes[2];
  for (const int threads : {1, 2}) {
    std::filesystem::remove(path_);
    create();
    for (int i = 1; i <= 3; ++i) insert(room(i, unsigned(i + 1)), threads);
    bytes[threads - 1] = file();
  }
  EXPECT_EQ(bytes[0], bytes[1]);
}

TEST_P(Living, WhatTheCacheForgetsChangesNothing) {
  Bytes bytes[2];
  for (const std::uint64_t cache : {std::uint64_t{0}, std::uint64_t{1} << 30}) {
    std::filesystem::remove(path_);
    create();
    UpdateSettings settings;
    settings.cache_bytes = cache;
    auto map = MapUpdater::open(path_, arena_, settings);
    ASSERT_TRUE(map.ok());
    for (int i = 1; i <= 3; ++i) {
      ASSERT_TRUE(map->insert(room(i, unsigned(i + 1))).ok());
      ASSERT_TRUE(map->commit(8).ok());
    }
    bytes[cache == 0] = file();
  }
  EXPECT_EQ(bytes[0], bytes[1]);
}

TEST_P(Living, UntouchedTilesStayAsTheyAre) {
  create();
  const auto before = MapFile::open(path_);
  insert(room(40, 5));
  const auto after = MapFile::open(path_);
  ASSERT_TRUE(before.ok() && after.ok());
  for (const TileRecord& t : before->archive().tiles()) {
    const auto i = after->archive().find(t.key);
    ASSERT_TRUE(i.has_value());
    EXPECT_EQ(after->archive().tiles()[*i].segments, t.segments);
  }
}

TEST_P(Living, EraseThenFold) {
  create();
  insert(room(1, 2));
  Erasure e;
  e.box = Box{{-1, -9, -9}, {1, 9, 9}};
  const auto count_inside = [&] {
    const PointCloud c = all();
    return std::count_if(c.xyz.begin(), c.xyz.end(), [&](const Vec3& p) { return e.box->contains(p); });
  };
  EXPECT_GT(count_inside(), 0);
  {
    auto map = MapUpdater::open(path_, arena_);
    ASSERT_TRUE(map.ok());
    ASSERT_TRUE(map->erase(e, std::nullopt).ok());
    ASSERT_TRUE(map->commit(8).ok());
  }
  const std::size_t left = all().size();
  EXPECT_EQ(count_inside(), 0);
  fold();
  EXPECT_EQ(all().size(), left);
  // Surfaces are spread anew by folding: a hair beyond the edge is no fault.
  EXPECT_LE(count_inside(), GetParam() == PromiseKind::rms ? 60 : 0);
}

TEST_P(Living, SubmapsFollowTheirPoses) {
  create();
  const std::size_t plain = all().size();
  {
    auto map = MapUpdater::open(path_, arena_);
    ASSERT_TRUE(map.ok());
    const auto s =
        map->submap("key frame 1", PoseChange{0, {100, 0, 0}, {0, 0, std::sqrt(0.5), std::sqrt(0.5)}});
    ASSERT_TRUE(s.ok());
    EXPECT_EQ(*s, 1u);
    ASSERT_TRUE(map->insert(room(0, 3), *s).ok());
    ASSERT_TRUE(map->commit(8).ok());
  }
  Region far;
  far.box = Box{{90, -10, -10}, {110, 10, 10}};
  const auto in_box = [&] {
    const auto map = MapFile::open(path_);
    return map->count(far).value();
  };
  EXPECT_EQ(all().size(), plain + 6000);
  EXPECT_EQ(in_box(), 6000u);
  const auto before = MapFile::open(path_);
  {
    auto map = MapUpdater::open(path_, arena_);
    const PoseChange back{1, {-100, 0, 0}, {0, 0, 0, 1}};
    ASSERT_TRUE(map->set_poses(std::span(&back, 1)).ok());
    ASSERT_TRUE(map->commit(9).ok());
  }
  EXPECT_EQ(in_box(), 0u);
  const auto after = MapFile::open(path_);
  ASSERT_EQ(before->archive().tiles().size(), after->archive().tiles().size());
  for (std::size_t i = 0; i < after->archive().tiles().size(); ++i)
    EXPECT_EQ(before->archive().tiles()[i].segments, after->archive().tiles()[i].segments);
}

TEST_P(Living, OtherChannelsAreRefused) {
  create();
  auto map = MapUpdater::open(path_, arena_);
  ASSERT_TRUE(map.ok());
  PointCloud bare = room(0, 2);
  bare.channels.clear();
  const Status s = map->insert(bare);
  ASSERT_FALSE(s.ok());
  EXPECT_EQ(s.error().code, ErrorCode::kMalformed);
  EXPECT_NE(s.error().message.find("rgb"), std::string::npos);
  PointCloud more = room(0, 2);
  more.channels.push_back({{"ring", ScalarType::u16, 1}, Bytes(2 * more.size())});
  EXPECT_TRUE(map->insert(more).ok());
}

TEST_P(Living, TwoWritersExcludeEachOther) {
  create();
  const auto one = MapUpdater::open(path_, arena_);
  ASSERT_TRUE(one.ok());
  const auto two = MapUpdater::open(path_, arena_);
  ASSERT_FALSE(two.ok());
  EXPECT_EQ(two.error().code, ErrorCode::kCannotWrite);
}

TEST_P(Living, NothingCountsBeforeCommit) {
  create();
  const std::size_t before = all().size();
  {
    auto map = MapUpdater::open(path_, arena_);
    ASSERT_TRUE(map->insert(room(30, 4)).ok());
    ASSERT_TRUE(map->flush().ok());
    EXPECT_EQ(all().size(), before);
  }
  EXPECT_EQ(all().size(), before);
  EXPECT_TRUE(insert(room(30, 4)).committed);
}

TEST_P(Living, WhatFailedHalfWayIsNeverCommitted) {
  create();
  const Bytes before = file();
  const std::atomic<bool> stop = true;
  UpdateSettings settings;
  settings.stop = &stop;
  auto map = MapUpdater::open(path_, arena_, settings);
  ASSERT_TRUE(map->insert(room(30, 4)).ok());
  EXPECT_EQ(map->flush().error().code, ErrorCode::kCancelled);
  EXPECT_EQ(map->commit(9).error().code, ErrorCode::kCancelled);
  EXPECT_EQ(file(), before);
}

/// Whether `b` lies within the cube of `a`.
bool holds(const TileKey& a, const TileKey& b) {
  const int up = a.level - b.level;
  return up >= 0 && b.x >> up == a.x && b.y >> up == a.y && b.z >> up == a.z;
}

/// A scanner that stands still fills its tiles far beyond what they were made for.
TEST_P(Living, TilesThatGrowAreSplit) {
  const PointCloud scan = room(0, 1, 2000);
  UpdateSettings settings;
  settings.split_points = 1000;
  settings.density_cap = false;
  for (const double color_error :
       {0.0, 10.0}) {  // exact colours: the parts stay pending; else they are folded
    CompressOptions o = options();
    o.tile_size_m = 0;
    o.color_error = color_error;
    o.overwrite = true;
    PointCloud whole = scan.like();
    std::uint64_t split = 0;
    {
      CloudSource first(scan);
      std::vector<std::string> warnings;
      auto map = create_map(path_, first, o, arena_, settings, warnings);
      ASSERT_TRUE(map.ok()) << map.error().message;
      for (unsigned seed = 1; seed <= 3; ++seed) {
        whole.append(room(0, seed, 2000));
        ASSERT_TRUE(map->insert(room(0, seed, 2000)).ok());
        const auto r = map->commit(seed);
        ASSERT_TRUE(r.ok()) << r.error().message;
        split += r->tiles_split;
      }
    }
    EXPECT_GT(split, 0u);
    const auto map = MapFile::open(path_);
    ASSERT_TRUE(map.ok());
    for (const TileRecord& a : map->archive().tiles())
      for (const TileRecord& b : map->archive().tiles()) EXPECT_TRUE(a.key == b.key || !holds(a.key, b.key));
    fold();
    SerialRunner runner;
    const auto e = evaluate(whole, all(), runner, {});
    ASSERT_TRUE(e.ok());
    EXPECT_EQ(e->points_decoded, whole.size());
    EXPECT_LE(e->rms_m, GetParam() == PromiseKind::max_error ? 0.02 * std::sqrt(3.0) : 0.02);
    EXPECT_LE(e->color_error, color_error * 1.05 + 1);  // of two points at one place either is the nearest
    EXPECT_LE(e->max_m, GetParam() == PromiseKind::lossless ? 0 : 1);
    // Later scans go into the parts, and what is known adds nothing.
    EXPECT_EQ(insert(room(0, 9, 2000), 2, settings).tiles_new, 0u);
    // A few points lie farther from the surfaces that stand for them than any known point may; but once.
    EXPECT_LE(insert(scan).points_added, GetParam() == PromiseKind::rms ? scan.size() / 500 : 0);
    EXPECT_EQ(insert(scan).points_added, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Promises, Living,
                         ::testing::Values(PromiseKind::rms, PromiseKind::max_error, PromiseKind::lossless),
                         [](const auto& promise) { return promise_name(promise.param); });

}  // namespace
}  // namespace mapcodec
