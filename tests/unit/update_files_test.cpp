// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/update.hpp"

namespace mapcodec {
namespace {

/// A wall before the sensor, with normals that face it or lean upwards.
PointCloud wall() {
  PointCloud c;
  c.channels.push_back({{"normal", ScalarType::f32, 3}, {}});
  c.resize(400);
  for (std::size_t i = 0; i < c.size(); ++i) {
    c.xyz[i] = {5, 0.25 * double(i % 20), 0.25 * double(i / 20)};
    c.channels[0].set(i, i % 2 == 0 ? -1.0F : -0.6F, 0);
    c.channels[0].set(i, 0.0F, 1);
    c.channels[0].set(i, i % 2 == 0 ? 0.0F : 0.8F, 2);
  }
  return c;
}

Status write(const std::string& path, const PointCloud& cloud) {
  MAPCODEC_ASSIGN(const auto sink, open_sink(path, cloud.like(), cloud.size()));
  MAPCODEC_TRY(sink->write(cloud));
  return sink->finish();
}

class UpdateFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder = std::filesystem::temp_directory_path() / ("mapcodec_update_files_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    scan = (folder / "scan.pcd").string();
    path = (folder / "map.mapc").string();
  }
  void TearDown() override { std::filesystem::remove_all(folder); }

  std::filesystem::path folder;
  std::string scan, path;
};

UpdateRequest of_max_error(const std::string& input) {
  UpdateRequest r;
  r.inputs = {input};
  r.create.emplace();
  r.create->promise = PromiseKind::max_error;
  r.create->promise_m = 0.001;
  return r;
}

/// All look at the sensor.
PointCloud flat_wall() {
  PointCloud c = wall();
  for (std::size_t i = 0; i < c.size(); ++i) {
    c.channels[0].set(i, -1.0F, 0);
    c.channels[0].set(i, 0.0F, 2);
  }
  return c;
}

TEST_F(UpdateFiles, WhatTheFirstScanHasEverywhereTheNextMayNot) {
  ASSERT_TRUE(write(scan, flat_wall()).ok());
  Arena arena(1);
  std::vector<std::string> warnings;
  const double half = std::sqrt(0.5);
  ASSERT_TRUE(update_files(path, of_max_error(scan), arena, warnings).ok());
  UpdateRequest turned = of_max_error(scan);
  turned.pose = PoseChange{0, {20, 0, 0}, {0, 0, half, half}};
  const auto done = update_files(path, turned, arena, warnings);
  ASSERT_TRUE(done.ok()) << done.error().message;
  EXPECT_EQ(done->points_added, 400u);
  const PointCloud cloud = MapFile::open(path)->read().value();
  const Channel* normal = cloud.find("normal");
  ASSERT_NE(normal, nullptr);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    EXPECT_NEAR(normal->get<float>(i, cloud.xyz[i][0] > 10 ? 1 : 0), -1, 1e-5);
}

TEST_F(UpdateFiles, WhatACompressedMapStoresOnceForGoodIsExplained) {
  ASSERT_TRUE(write(scan, flat_wall()).ok());
  CompressOptions options;
  options.promise = PromiseKind::max_error;
  options.promise_m = 0.001;
  ASSERT_TRUE(compress_files({scan}, path, options).ok());
  Arena arena(1);
  std::vector<std::string> warnings;
  UpdateRequest turned = of_max_error(scan);
  turned.pose = PoseChange{0, {20, 0, 0}, {0, 0, 1, 0}};
  const auto refused = update_files(path, turned, arena, warnings);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("update --create"), std::string::npos) << refused.error().message;
  // The advice works.
  const std::string another = (folder / "another.mapc").string();
  ASSERT_TRUE(update_files(another, turned, arena, warnings).ok());
  MergeRequest merge;
  merge.others = {path};
  const auto merged = merge_maps(another, merge, arena, warnings);
  ASSERT_TRUE(merged.ok()) << merged.error().message;
  EXPECT_EQ(merged->points_added, 400u);
}

TEST_F(UpdateFiles, NormalsTurnWithThePose) {
  ASSERT_TRUE(write(scan, wall()).ok());
  Arena arena(1);
  const double half = std::sqrt(0.5);  // a quarter turn about z: what faced -x faces -y
  for (const bool submap : {false, true}) {
    UpdateRequest r = of_max_error(scan);
    r.pose = PoseChange{0, {1, 2, 3}, {0, 0, half, half}};
    if (submap) r.submap = "keyframe";
    std::filesystem::remove(path);
    std::vector<std::string> warnings;
    const auto done = update_files(path, r, arena, warnings);
    ASSERT_TRUE(done.ok()) << done.error().message;
    const auto map = MapFile::open(path);
    ASSERT_TRUE(map.ok());
    const auto cloud = map->read();
    ASSERT_TRUE(cloud.ok());
    ASSERT_EQ(cloud->size(), 400u);
    const Channel* normal = cloud->find("normal");
    ASSERT_NE(normal, nullptr);
    for (std::size_t i = 0; i < cloud->size(); ++i) {
      EXPECT_NEAR(cloud->xyz[i][1], 2 + 5, 0.001);
      EXPECT_NEAR(normal->get<float>(i, 0), 0, 0.02);
      const float y = normal->get<float>(i, 1), z = normal->get<float>(i, 2);
      EXPECT_NEAR(y, z > 0.4F ? -0.6 : -1, 0.02);
      EXPECT_NEAR(z, z > 0.4F ? 0.8 : 0, 0.02);
    }
  }
}

}  // namespace
}  // namespace mapcodec
