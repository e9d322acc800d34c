// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/local_map.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include <algorithm>
#include <chrono>
#include <thread>

#include "slam_adapter/local_map_plan.hpp"
#include "tests/unit/maps_support.hpp"

namespace mapcodec {
namespace {

using maps_test::TemporaryFolder;
using Clock = std::chrono::steady_clock;

constexpr double kTile = 10;
constexpr double kStep = 0.01;
constexpr double kLong = 20;  // [s] what no test ever waits for

MapSchema schema_at(const Vec3& origin) {
  MapSchema s;
  s.promise_value = kStep;
  s.origin = origin;
  s.tile_size_m = kTile;
  s.step_m = kStep;
  return s;
}

/// Bumpy ground and a wall in one tile.
PointCloud scene(const TileKey& key, const Vec3& origin, std::size_t count) {
  std::mt19937_64 random(static_cast<std::uint64_t>(key.x * 131 + key.y * 17 + key.z + 7));
  std::uniform_real_distribution<double> part(0.001, 0.999);
  PointCloud c;
  for (std::size_t i = 0; i < count; ++i) {
    const double a = kTile * part(random), b = kTile * part(random);
    const Vec3 p = i % 3 == 0 ? Vec3{3, a, b} : Vec3{a, b, 1 + 0.1 * std::sin(a)};
    c.xyz.push_back({origin[0] + key.x * kTile + p[0], origin[1] + key.y * kTile + p[1],
                     origin[2] + key.z * kTile + p[2]});
  }
  return c;
}

EncodedTile encoded(const PointCloud& points, const MapSchema& schema, CodecId codec) {
  TileSettings settings;
  settings.codec = codec;
  auto tile = encode_tile(points, schema, settings);
  EXPECT_TRUE(tile.ok()) << tile.error().to_string();
  return std::move(*tile);
}

struct TestMap {
  std::string path;
  std::vector<Vec3> truth;  // decoded points [m, submap frame]
};

struct MapSpec {
  int columns = 10;
  std::size_t points = 2000;
  Vec3 origin{0, 0, 0};
  CodecId codec = CodecId::points;
  std::vector<Submap> submaps;
};

void add_scene(MapWriter& writer, const MapSchema& schema, const TileKey& key, const MapSpec& spec,
               std::uint32_t submap, std::vector<Vec3>* truth) {
  const EncodedTile t = encoded(scene(key, spec.origin, spec.points), schema, spec.codec);
  ASSERT_TRUE(writer.add(key, std::uint8_t(t.codec), t.points, t.bounds, t.errors, t.bytes, submap).ok());
  if (truth == nullptr) return;
  const auto decoded = decode_tile(t.bytes, schema);
  ASSERT_TRUE(decoded.ok());
  truth->insert(truth->end(), decoded->xyz.begin(), decoded->xyz.end());
}

TestMap write_test_map(const std::string& path, const MapSpec& spec = {}) {
  TestMap map{path, {}};
  MapInfo info = maps_test::sample_info(spec.origin, kTile);
  const MapSchema schema = schema_at(spec.origin);
  info.schema = write_schema(schema);
  info.submaps = spec.submaps;
  info.bounds = {spec.origin,
                 {spec.origin[0] + spec.columns * kTile, spec.origin[1] + kTile, spec.origin[2] + kTile}};
  auto writer = MapWriter::create(path, info, true);
  EXPECT_TRUE(writer.ok()) << writer.error().to_string();
  const std::uint32_t submaps = std::max<std::uint32_t>(1, static_cast<std::uint32_t>(spec.submaps.size()));
  for (std::uint32_t s = 0; s < submaps; ++s)
    for (int x = 0; x < spec.columns; ++x) add_scene(*writer, schema, {x, 0, 0, 0}, spec, s, &map.truth);
  EXPECT_TRUE(writer->commit(1).ok());
  return map;
}

MapPose at(double x, double y = 5, double z = 1) {
  return {{x, y, z}, {0, 0, 0, 1}};
}

LocalMapSettings around(double radius_m) {
  LocalMapSettings s;
  s.radius_m = radius_m;
  return s;
}

std::unique_ptr<LocalMap> open_map(const std::string& path, const LocalMapSettings& s, Arena& arena) {
  auto map = LocalMap::open(path, s, arena);
  EXPECT_TRUE(map.ok()) << map.error().to_string();
  return std::move(*map);
}

std::shared_ptr<const LocalMapView> ready_view(LocalMap& map, const MapPose& pose) {
  EXPECT_TRUE(map.move_to(pose).ok());
  const auto ready = map.wait_ready(kLong);
  EXPECT_TRUE(ready.ok()) << ready.error().to_string();
  EXPECT_TRUE(ready.ok() && *ready);
  return map.view();
}

std::set<int> columns(const LocalMapView& view) {
  std::set<int> r;
  for (const auto& t : view.tiles()) r.insert(t.content->key.x);
  return r;
}

double squared(const Vec3& a, const Vec3& b) {
  double s = 0;
  for (std::size_t d = 0; d < 3; ++d) s += (a[d] - b[d]) * (a[d] - b[d]);
  return s;
}

TEST(LocalMap, HoldsWhatIsNear) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"));
  Arena arena(2);
  const auto local = open_map(map.path, around(12), arena);
  EXPECT_EQ(local->view()->tiles().size(), 0u);
  EXPECT_FALSE(*local->wait_ready(0));
  const auto view = ready_view(*local, at(45));
  EXPECT_EQ(columns(*view), (std::set<int>{3, 4, 5}));
  EXPECT_EQ(view->points(), 6000u);
  EXPECT_EQ(view->revision(), 1u);
  EXPECT_TRUE(view->faults().empty());
  EXPECT_EQ(view->cloud().size(), 6000u);
}

TEST(LocalMap, NearestIsThatOfAllPoints) {
  for (const double offset : {0.0, 1e6}) {
    const TemporaryFolder folder;
    MapSpec spec;
    spec.columns = 4;
    spec.origin = {offset, -offset, 0};
    const TestMap map = write_test_map(folder.path("m.mapc"), spec);
    Arena arena(2);
    const auto local = open_map(map.path, around(100), arena);
    const auto view = ready_view(*local, {{offset + 20, -offset + 5, 0}, {0, 0, 0, 1}});
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> part(-2, 42);
    for (int i = 0; i < 100; ++i) {
      const Vec3 q{offset + part(random), -offset + part(random) / 4, part(random) / 4};
      std::vector<double> all;
      for (const Vec3& p : map.truth) all.push_back(squared(p, q));
      std::sort(all.begin(), all.end());
      const auto hits = view->nearest(q, 5);
      ASSERT_EQ(hits.size(), 5u);
      for (std::size_t k = 0; k < 5; ++k) {
        EXPECT_NEAR(hits[k].distance_m, std::sqrt(all[k]), 1e-5);
        EXPECT_NEAR(std::sqrt(squared(view->point(hits[k]), q)), hits[k].distance_m, 1e-5);
      }
      const auto in_ball = view->within(q, 1.5);
      const auto count = std::upper_bound(all.begin(), all.end(), 1.5 * 1.5) - all.begin();
      EXPECT_NEAR(double(in_ball.size()), double(count), 1);
      EXPECT_TRUE(std::is_sorted(in_ball.begin(), in_ball.end(),
                                 [](const auto& a, const auto& b) { return a.distance_m < b.distance_m; }));
      EXPECT_LE(view->nearest(q, 3, 0.1).size(), 3u);
    }
    EXPECT_TRUE(view->nearest({NAN, 0, 0}).empty());
    EXPECT_TRUE(view->nearest({0, 0, 0}, 0).empty());
  }
}

TEST(LocalMap, OldViewsStay) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"));
  Arena arena(2);
  std::shared_ptr<const LocalMapView> first;
  {
    const auto local = open_map(map.path, around(8), arena);
    first = ready_view(*local, at(5));
    const auto last = ready_view(*local, at(95));
    EXPECT_EQ(columns(*last), (std::set<int>{8, 9}));
  }
  EXPECT_EQ(columns(*first), (std::set<int>{0, 1}));
  EXPECT_EQ(first->nearest({5, 5, 1}, 1).size(), 1u);
}

TEST(LocalMap, KeepsWithinTheKeepRadius) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"));
  Arena arena(2);
  LocalMapSettings s = around(8);
  s.keep_radius_m = 16;
  s.ahead_s = 0;
  const auto local = open_map(map.path, s, arena);
  EXPECT_EQ(columns(*ready_view(*local, at(5))), (std::set<int>{0, 1}));
  EXPECT_EQ(columns(*ready_view(*local, at(15))), (std::set<int>{0, 1, 2}));
  EXPECT_EQ(columns(*ready_view(*local, at(25))), (std::set<int>{0, 1, 2, 3}));
  EXPECT_EQ(columns(*ready_view(*local, at(35))), (std::set<int>{1, 2, 3, 4}));
}

TEST(LocalMap, FetchesWhatLiesAhead) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"));
  Arena arena(2);
  LocalMapSettings s = around(6);
  s.keep_radius_m = 1000;
  s.ahead_s = 2;
  const auto local = open_map(map.path, s, arena);
  ASSERT_TRUE(local->move_to(at(5), 0.0).ok());
  ASSERT_TRUE(local->move_to(at(15), 1.0).ok());  // 10 m/s: column 4 begins 19 m from the circle's edge
  const auto begin = Clock::now();
  while (!columns(*local->view()).contains(4) && Clock::now() - begin < std::chrono::seconds(20))
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_TRUE(columns(*local->view()).contains(4));
  EXPECT_FALSE(columns(*local->view()).contains(6));
}

TestMap long_map(const TemporaryFolder& folder) {
  MapSpec spec;
  spec.columns = 40;
  return write_test_map(folder.path("m.mapc"), spec);
}

TEST(LocalMap, NeverMoreThanTheBudget) {
  const TemporaryFolder folder;
  const TestMap map = long_map(folder);
  Arena arena(2);
  LocalMapSettings s = around(12);
  s.memory_bytes = 600'000;
  const auto local = open_map(map.path, s, arena);
  for (int i = 0; i < 80; ++i) {
    const auto view = ready_view(*local, at(5 * i));
    EXPECT_LE(local->memory().used, s.memory_bytes);
    EXPECT_FALSE(view->starved());
  }
  EXPECT_LE(local->memory().peak, s.memory_bytes);
  EXPECT_GT(local->memory().peak, s.memory_bytes / 3);
}

TEST(LocalMap, ViewsThatAreHeldCount) {
  const TemporaryFolder folder;
  const TestMap map = long_map(folder);
  Arena arena(2);
  LocalMapSettings s = around(12);
  s.memory_bytes = 500'000;
  const auto local = open_map(map.path, s, arena);
  std::vector<std::shared_ptr<const LocalMapView>> held;
  bool ready = true;
  for (int i = 0; i < 20 && ready; ++i) {
    ASSERT_TRUE(local->move_to(at(20 * i)).ok());
    const auto waited = local->wait_ready(0.5);
    ready = waited.ok() && *waited;
    held.push_back(local->view());
  }
  EXPECT_FALSE(ready);
  EXPECT_LE(local->memory().peak, s.memory_bytes);
  held.clear();
  const auto now = local->wait_ready(kLong);
  ASSERT_TRUE(now.ok()) << now.error().to_string();
  EXPECT_TRUE(*now);
}

TEST(LocalMap, SaysThatTheBudgetIsTooSmall) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"));
  Arena arena(2);
  LocalMapSettings s = around(12);
  s.memory_bytes = 20'000;  // less than one tile
  auto local = open_map(map.path, s, arena);
  ASSERT_TRUE(local->move_to(at(45)).ok());
  auto ready = local->wait_ready(kLong);
  ASSERT_FALSE(ready.ok());
  EXPECT_EQ(ready.error().code, ErrorCode::kLimitExceeded);
  EXPECT_NE(ready.error().message.find("budget"), std::string::npos);
  EXPECT_EQ(local->view()->faults().size(), 3u);

  s = around(45);
  s.memory_bytes = 300'000;  // some tiles, not all: the nearest
  local = open_map(map.path, s, arena);
  ASSERT_TRUE(local->move_to(at(45)).ok());
  ready = local->wait_ready(kLong);
  ASSERT_FALSE(ready.ok());
  EXPECT_EQ(ready.error().code, ErrorCode::kLimitExceeded);
  EXPECT_TRUE(local->view()->starved());
  EXPECT_TRUE(columns(*local->view()).contains(4));
  EXPECT_FALSE(columns(*local->view()).contains(9));
  EXPECT_LE(local->memory().peak, s.memory_bytes);
}

TEST(LocalMap, DamagedTilesAreFaults) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"));
  std::uint64_t offset = 0;
  {
    const auto archive = MapArchive::open(map.path);
    offset = archive->tiles()[*archive->find({4, 0, 0, 0})].segments[0].offset;
  }
  Bytes bytes = maps_test::read_file(map.path);
  bytes[offset + 5] ^= 1;
  maps_test::write_file(map.path, bytes);
  Arena arena(2);
  const auto local = open_map(map.path, around(12), arena);
  const auto view = ready_view(*local, at(45));
  EXPECT_EQ(columns(*view), (std::set<int>{3, 5}));
  ASSERT_EQ(view->faults().size(), 1u);
  EXPECT_EQ(view->faults()[0].key.x, 4);
  EXPECT_EQ(view->faults()[0].error.code, ErrorCode::kChecksumMismatch);
}

TEST(LocalMap, PayloadThatLiesIsAFault) {
  const TemporaryFolder folder;
  MapInfo info = maps_test::sample_info({0, 0, 0}, kTile);
  const MapSchema schema = schema_at({0, 0, 0});
  info.schema = write_schema(schema);
  auto writer = MapWriter::create(folder.path("m.mapc"), info, true);
  const EncodedTile t = encoded(scene({}, {0, 0, 0}, 5000), schema, CodecId::points);
  // The index says one point: what is reserved for it must not be overrun.
  ASSERT_TRUE(writer->add({}, std::uint8_t(t.codec), 1, t.bounds, t.errors, t.bytes).ok());
  ASSERT_TRUE(writer->add({1, 0, 0, 0}, 2, 100, t.bounds, {}, maps_test::random_bytes(100, 1)).ok());
  ASSERT_TRUE(writer->commit(1).ok());
  Arena arena(2);
  const auto local = open_map(folder.path("m.mapc"), around(12), arena);
  const auto view = ready_view(*local, at(5));
  EXPECT_EQ(view->tiles().size(), 0u);
  ASSERT_EQ(view->faults().size(), 2u);
  for (const auto& f : view->faults()) EXPECT_EQ(f.error.code, ErrorCode::kArchiveDamaged);
}

TEST(LocalMap, SubmapsStandWhereTheirPosesSay) {
  const TemporaryFolder folder;
  MapSpec spec;
  spec.columns = 2;
  spec.submaps.resize(2);
  spec.submaps[0].name = "a";
  spec.submaps[1].name = "b";
  spec.submaps[1].translation_m = {100, 0, 0};
  spec.submaps[1].rotation_xyzw = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};  // x becomes y
  const TestMap map = write_test_map(folder.path("m.mapc"), spec);
  Arena arena(2);
  const auto local = open_map(map.path, around(30), arena);
  const auto view = ready_view(*local, at(95, 10));
  ASSERT_EQ(view->tiles().size(), 2u);
  EXPECT_EQ(view->tiles()[0].content->submap, 1u);
  const Vec3 p = map.truth.back();  // of the second submap
  const auto hit = view->nearest({100 - p[1], p[0], p[2]}, 1);
  ASSERT_EQ(hit.size(), 1u);
  EXPECT_LT(hit[0].distance_m, 1e-5);

  // A loop closure moves it: the same tiles at another place, none is decoded again.
  {
    auto writer = MapWriter::open(map.path);
    ASSERT_TRUE(writer.ok());
    const PoseChange change{1, {95, 2, 0}, {0, 0, 0, 1}};
    ASSERT_TRUE(writer->set_poses({&change, 1}).ok());
    ASSERT_TRUE(writer->commit(2).ok());
  }
  const auto newer = local->refresh();
  ASSERT_TRUE(newer.ok() && *newer);
  EXPECT_FALSE(*local->refresh());
  ASSERT_TRUE(*local->wait_ready(kLong));
  const auto moved = local->view();
  EXPECT_EQ(moved->revision(), 2u);

  // The file goes away: what is loaded stays, and looking for news says why there are none.
  std::filesystem::remove(map.path);
  EXPECT_EQ(local->refresh().error().code, ErrorCode::kNotFound);
  EXPECT_EQ(local->view()->revision(), 2u);
  EXPECT_TRUE(local->view()->ready());
  ASSERT_EQ(moved->tiles().size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(moved->tiles()[i].content, view->tiles()[i].content);
  EXPECT_LT(moved->nearest({95 + p[0], 2 + p[1], p[2]}, 1)[0].distance_m, 1e-5);
}

TEST(LocalMap, RefreshLoadsWhatChanged) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"));
  Arena arena(2);
  const auto local = open_map(map.path, around(12), arena);
  const auto before = ready_view(*local, at(45));
  const MapSchema schema = schema_at({0, 0, 0});
  {
    auto writer = MapWriter::open(map.path);
    ASSERT_TRUE(writer.ok());
    const EncodedTile delta = encoded(scene({4, 0, 0, 0}, {0, 0, 0}, 500), schema, CodecId::points);
    const TileRecord* old = writer->find({4, 0, 0, 0});
    ASSERT_TRUE(
        writer->extend({4, 0, 0, 0}, old->points + delta.points, old->bounds, delta.errors, delta.bytes)
            .ok());
    ASSERT_TRUE(writer->remove({5, 0, 0, 0}).ok());
    ASSERT_TRUE(writer->commit(2).ok());
  }
  ASSERT_TRUE(*local->refresh());
  ASSERT_TRUE(*local->wait_ready(kLong));
  const auto after = local->view();
  EXPECT_EQ(columns(*after), (std::set<int>{3, 4}));
  EXPECT_EQ(after->points(), 4500u);
  EXPECT_EQ(after->tiles()[0].content, before->tiles()[0].content);
  EXPECT_EQ(before->points(), 6000u);
  auto first = MapArchive::open(map.path, 1);
  ASSERT_TRUE(local->refresh(std::make_shared<MapArchive>(std::move(*first))).ok());
  ASSERT_TRUE(*local->wait_ready(kLong));
  EXPECT_EQ(local->view()->points(), 6000u);
}

TEST(LocalMap, CoarseFirst) {
  const TemporaryFolder folder;
  MapSpec spec;
  spec.codec = CodecId::surface;
  const TestMap map = write_test_map(folder.path("m.mapc"), spec);
  Arena arena(2);
  LocalMapSettings s = around(12);
  s.coarse_level = 4;
  s.content.patches = true;
  const auto local = open_map(map.path, s, arena);
  ASSERT_TRUE(local->move_to(at(45)).ok());
  ASSERT_TRUE(*local->wait_coarse(kLong));
  EXPECT_EQ(columns(*local->view()), (std::set<int>{3, 4, 5}));
  ASSERT_TRUE(*local->wait_ready(kLong));
  const auto view = local->view();
  EXPECT_EQ(view->points(), 6000u);
  EXPECT_GT(view->patches(), 0u);
  for (const auto& t : view->tiles()) EXPECT_FALSE(t.content->level.has_value());
}

TEST(LocalMap, PatchesAlone) {
  const TemporaryFolder folder;
  MapSpec spec;
  spec.codec = CodecId::surface;
  const TestMap map = write_test_map(folder.path("m.mapc"), spec);
  Arena arena(2);
  LocalMapSettings s = around(12);
  s.content.points = false;
  s.content.patches = true;
  const auto local = open_map(map.path, s, arena);
  const auto view = ready_view(*local, at(45));
  EXPECT_EQ(view->points(), 0u);
  ASSERT_GT(view->patches(), 10u);
  const auto hit = view->nearest_patches({43, 5, 5});
  ASSERT_EQ(hit.size(), 1u);
  const auto plane = view->plane(hit[0]);
  EXPECT_NEAR(plane.center[0], 43, 0.05);  // the wall
  EXPECT_NEAR(std::abs(plane.normal[0]), 1, 0.05);
}

TEST(LocalMap, RefusesNonsense) {
  const TemporaryFolder folder;
  const TestMap map = write_test_map(folder.path("m.mapc"), {.columns = 1, .points = 10, .submaps = {}});
  Arena arena(1);
  for (const double radius : {0.0, -1.0, double(NAN), double(INFINITY)})
    EXPECT_EQ(LocalMap::open(map.path, around(radius), arena).error().code, ErrorCode::kInvalidArgument);
  LocalMapSettings s = around(10);
  s.keep_radius_m = 5;
  EXPECT_FALSE(LocalMap::open(map.path, s, arena).ok());
  s = around(10);
  s.memory_bytes = 0;
  EXPECT_FALSE(LocalMap::open(map.path, s, arena).ok());
  EXPECT_EQ(LocalMap::open(folder.path("none"), around(1), arena).error().code, ErrorCode::kNotFound);
  const auto local = open_map(map.path, around(10), arena);
  EXPECT_FALSE(local->move_to({{NAN, 0, 0}, {0, 0, 0, 1}}).ok());
  EXPECT_FALSE(local->move_to({{0, 0, 0}, {0, 0, 0, 2}}).ok());
  EXPECT_FALSE(local->move_to(at(0), double(NAN)).ok());
  EXPECT_EQ(local->view()->tiles().size(), 0u);
  EXPECT_EQ(ready_view(*local, at(1e9))->tiles().size(), 0u);
}

TEST(LocalMap, NeverWaitsLongerThanAsked) {
  const TemporaryFolder folder;
  MapSpec spec;
  spec.columns = 5;
  spec.points = 100'000;
  const TestMap map = write_test_map(folder.path("m.mapc"), spec);
  Arena arena(1);
  const auto local = open_map(map.path, around(1000), arena);
  double longest = 0;
  for (int i = 0; i < 20; ++i) {
    const auto begin = Clock::now();
    ASSERT_TRUE(local->move_to(at(i)).ok());
    ASSERT_TRUE(local->wait_ready(0).ok());
    (void)local->view();
    longest = std::max(longest, std::chrono::duration<double>(Clock::now() - begin).count());
  }
  EXPECT_LT(longest, 0.02);
}

TEST(LocalMap, ManyThreadsAtOnce) {
  const TemporaryFolder folder;
  MapSpec spec;
  spec.columns = 30;
  spec.points = 1000;
  const TestMap map = write_test_map(folder.path("m.mapc"), spec);
  Arena arena(2);
  LocalMapSettings s = around(20);
  s.memory_bytes = 700'000;
  const auto local = open_map(map.path, s, arena);
  std::atomic<bool> stop{false};
  std::atomic<std::size_t> found{0};
  std::vector<std::thread> readers;
  for (int r = 0; r < 2; ++r) {
    readers.emplace_back([&] {
      while (!stop) {
        const auto view = local->view();
        found += view->nearest(view->center(), 3).size();
      }
    });
  }
  for (int i = 0; i < 200; ++i) {
    ASSERT_TRUE(local->move_to(at(i * 1.5)).ok());
    if (i % 10 == 0) {
      ASSERT_TRUE(local->wait_ready(0.01).ok());
    }
    if (i % 50 == 0) {
      ASSERT_TRUE(local->refresh().ok());
    }
  }
  EXPECT_TRUE(*local->wait_ready(kLong));
  while (found == 0) std::this_thread::yield();
  stop = true;
  for (std::thread& t : readers) t.join();
  EXPECT_GT(found, 0u);
  EXPECT_LE(local->memory().peak, s.memory_bytes);
}

TEST(LocalMapPlan, SoonestFirst) {
  std::vector<Box> boxes;
  for (int i = 0; i < 10; ++i) boxes.push_back({{10.0 * i, 0, 0}, {10.0 * i + 10, 10, 10}});
  boxes.push_back({});  // a tile without place
  const auto standing = wanted_tiles(boxes, {5, 5, 5}, {0, 0, 0}, {12, 3});
  ASSERT_EQ(standing.size(), 2u);
  EXPECT_EQ(standing[0].tile, 0u);
  const auto driving = wanted_tiles(boxes, {5, 5, 5}, {10, 0, 0}, {12, 3});
  ASSERT_EQ(driving.size(), 5u);  // up to 5 + 12 + 30 m
  for (std::size_t i = 0; i < driving.size(); ++i) {
    EXPECT_EQ(driving[i].tile, i);
    EXPECT_EQ(driving[i].near, i < 2);
  }
  EXPECT_TRUE(wanted_tiles({}, {0, 0, 0}, {1, 0, 0}, {12, 3}).empty());
}

TEST(LocalMapPlan, SpeedFromPoses) {
  Motion m;
  m.move_to({0, 0, 0}, 0);
  EXPECT_EQ(m.velocity(), (Vec3{0, 0, 0}));
  m.move_to({1, 0, 0}, 0.1);
  EXPECT_NEAR(m.velocity()[0], 10, 1e-9);
  m.move_to({1, 0, 0}, 0.1);  // the same moment again says nothing
  EXPECT_NEAR(m.velocity()[0], 10, 1e-9);
  m.move_to({5000, 0, 0}, 0.2);  // relocalised
  EXPECT_EQ(m.velocity(), (Vec3{0, 0, 0}));
}

}  // namespace
}  // namespace mapcodec
