// SPDX-License-Identifier: GPL-3.0-or-later
// Octrees beside points: where poses, merging and flattening leave them.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "mapcodec/cloud/cloud_source.hpp"
#include "mapcodec/cloud/occupancy_edit.hpp"
#include "slam_adapter/map_source.hpp"
#include "slam_adapter/octomap/occupancy_map.hpp"
#include "slam_adapter/update.hpp"
#include "tests/unit/occupancy_support.hpp"

namespace mapcodec {
namespace {

using test::bubble;

class OctreeLayers : public testing::Test {
 protected:
  OctreeLayers() {
    folder_ = std::filesystem::temp_directory_path() / ("mapcodec-layer-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  ~OctreeLayers() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string path(const char* name) const { return (folder_ / name).string(); }

  /// An archive of points, and beside them of the octree, if one is given.
  std::string points(const char* name, const OccupancyTree* tree = nullptr, double resolution_m = 0.1) {
    PointCloud cloud;
    for (int i = 0; i < 400; ++i) cloud.xyz.push_back({0.1 * (i % 20), 0.1 * (i / 20), 0});
    CloudSource source(cloud);
    CompressOptions options;
    options.promise = PromiseKind::max_error;
    const auto report = compress(source, path(name), options);
    EXPECT_TRUE(report.ok());
    if (tree != nullptr) {
      EXPECT_TRUE(update_occupancy_map(path(name), *tree, resolution_m, {}).ok());
    }
    return path(name);
  }
  /// As archives are that were moved before this was refused.
  static void move(const std::string& archive) {
    auto writer = MapWriter::open(archive);
    ASSERT_TRUE(writer.ok());
    PoseChange pose;
    pose.submap = *octree_submap(writer->info());
    pose.translation_m = {1, 0, 0};
    ASSERT_TRUE(writer->set_poses(std::span(&pose, 1)).ok());
    ASSERT_TRUE(writer->commit(0).ok());
  }
  Result<UpdateReport> merge(const std::string& map, const std::string& other) {
    MergeRequest request;
    request.others = {other};
    warnings_.clear();
    return merge_maps(map, request, arena_, warnings_);
  }
  static OccupancyTree tree_of(const std::string& archive) {
    const auto map = OccupancyMap::open(archive);
    EXPECT_TRUE(map.ok());
    return map.ok() ? map->read().value() : OccupancyTree{};
  }

  std::filesystem::path folder_;
  Arena arena_{2};
  std::vector<std::string> warnings_;
  const OccupancyTree tree_ = bubble(OccupancyKind::binary, 9), other_ = bubble(OccupancyKind::binary, 7, 3);
};

void expect_moved(const Error& e) {
  EXPECT_EQ(e.code, ErrorCode::kUnsupported);
  for (const char* words : {"cannot be moved", "the verb pose", "--as bt"})
    EXPECT_NE(e.message.find(words), std::string::npos) << e.message;
}

TEST_F(OctreeLayers, UpdatersRefuseToMoveThem) {
  const std::string map = points("m.mapc", &tree_);
  auto updater = MapUpdater::open(map, arena_);
  ASSERT_TRUE(updater.ok());
  PoseChange pose;
  pose.submap = *octree_submap(updater->info());
  EXPECT_TRUE(updater->set_poses(std::span(&pose, 1)).ok());
  pose.translation_m = {0, 0, 1};
  expect_moved(updater->set_poses(std::span(&pose, 1)).error());
  expect_moved(updater->submap("octree", pose).error());
  PointCloud cloud;
  cloud.xyz.push_back({0, 0, 0});
  EXPECT_EQ(updater->insert(cloud, pose.submap).error().code, ErrorCode::kUnsupported);
  EXPECT_TRUE(updater->insert(cloud, 0).ok());
}

TEST_F(OctreeLayers, FlatteningKeepsThem) {
  const std::string map = points("m.mapc", &tree_);
  const auto report = flatten_map(map, path("flat.mapc"), {});
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  EXPECT_TRUE(tree_of(path("flat.mapc")) == tree_);
  EXPECT_EQ(MapFile::open(path("flat.mapc"))->archive().revision(), 1u);
  move(map);
  expect_moved(flatten_map(map, path("moved.mapc"), {}).error());
  EXPECT_FALSE(std::filesystem::exists(path("moved.mapc")));
  ASSERT_TRUE(create_occupancy_map(path("o.mapc"), tree_, 0.1, {}).ok());
  EXPECT_EQ(flatten_map(path("o.mapc"), path("x.mapc"), {}).error().code, ErrorCode::kUnsupported);
}

TEST_F(OctreeLayers, MergingLaysThemOver) {
  const std::string plain = points("plain.mapc"), both = points("both.mapc", &tree_),
                    other = points("other.mapc", &other_);
  const auto first = merge(plain, both);
  ASSERT_TRUE(first.ok()) << first.error().to_string();
  EXPECT_TRUE(first->committed);
  EXPECT_EQ(first->revision, 2u);
  EXPECT_EQ(first->points_added, 0u);  // the same points: only the octree is new
  EXPECT_TRUE(tree_of(plain) == tree_);
  EXPECT_FALSE(merge(plain, both)->committed);
  ASSERT_TRUE(merge(plain, other).ok());
  EXPECT_TRUE(tree_of(plain) == overlay(tree_, other_));
  EXPECT_TRUE(warnings_.empty());

  ASSERT_TRUE(create_occupancy_map(path("o.mapc"), other_, 0.1, {}).ok());
  ASSERT_TRUE(merge(both, path("o.mapc")).ok());
  EXPECT_TRUE(tree_of(both) == overlay(tree_, other_));
  ASSERT_TRUE(create_occupancy_map(path("o2.mapc"), tree_, 0.1, {}).ok());
  ASSERT_TRUE(merge(path("o.mapc"), path("o2.mapc")).ok());
  EXPECT_TRUE(tree_of(path("o.mapc")) == overlay(other_, tree_));
}

TEST_F(OctreeLayers, MergingRefusesMovedOnes) {
  const std::string plain = points("plain.mapc"), moved = points("moved.mapc", &tree_),
                    other = points("other.mapc", &other_);
  move(moved);
  const auto refused = merge(plain, moved);
  expect_moved(refused.error());
  EXPECT_NE(refused.error().message.find("moved.mapc"), std::string::npos);
  EXPECT_EQ(MapFile::open(plain)->archive().revision(), 1u);
  const auto own = merge(moved, other);
  expect_moved(own.error());
  EXPECT_EQ(own.error().message.find("other.mapc"), std::string::npos) << own.error().message;
  expect_moved(update_occupancy_map(moved, other_, 0.1, {}).error());
}

TEST_F(OctreeLayers, AnotherResolutionIsLeftOutAloud) {
  const std::string map = points("m.mapc", &tree_), other = points("other.mapc", &other_, 0.2);
  ASSERT_TRUE(merge(map, other).ok());
  ASSERT_EQ(warnings_.size(), 1u);
  EXPECT_NE(warnings_[0].find("octree is left out"), std::string::npos);
  EXPECT_TRUE(tree_of(map) == tree_);
  ASSERT_TRUE(create_occupancy_map(path("o.mapc"), other_, 0.2, {}).ok());
  EXPECT_EQ(merge(map, path("o.mapc")).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(OctreeLayers, PointsInASubmapOfTheirName) {
  const std::string map = points("m.mapc");
  {
    auto updater = MapUpdater::open(map, arena_);
    ASSERT_TRUE(updater.ok());
    ASSERT_TRUE(updater->submap("octree", std::nullopt).ok());
    ASSERT_TRUE(updater->commit(1).ok());
  }
  ASSERT_TRUE(update_occupancy_map(map, tree_, 0.1, {}).ok());
  const auto file = MapFile::open(map);
  EXPECT_EQ(file->archive().info().submaps.at(*octree_submap(file->archive().info())).name, "octree-2");
  EXPECT_TRUE(tree_of(map) == tree_);
}

}  // namespace
}  // namespace mapcodec
