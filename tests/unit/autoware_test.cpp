// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <random>

#include "mapcodec/quality/multiset_hash.hpp"
#include "slam_adapter/autoware/autoware_folder.hpp"
#include "slam_adapter/autoware/autoware_metadata.hpp"
#include "slam_adapter/compress.hpp"
#include "tests/unit/formats_support.hpp"

namespace mapcodec {
namespace {

using namespace formats_test;

/// Points of float32 with intensity over an area that crosses the axes, some on the borders of tiles.
PointCloud street(std::size_t count) {
  std::mt19937 random(1);
  PointCloud c;
  c.channels.push_back({{"intensity", ScalarType::f32, 1}, {}});
  c.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    c.xyz[i] = {double(float(random() % 9000) / 100 - 35), double(float(random() % 5000) / 100 - 25),
                double(float(random() % 300) / 100)};
    if (i % 10 == 0) c.xyz[i][0] = -20;
    if (i % 10 == 1) c.xyz[i][1] = 20;
    c.channels[0].set(i, float(i % 100));
  }
  return c;
}

MultisetHash hash_of(const PointCloud& cloud) {
  MultisetHash h;
  h.add(cloud);
  return h;
}

CompressOptions lossless() {
  CompressOptions o;
  o.promise = PromiseKind::lossless;
  o.promise_m = 0;
  o.tile_size_m = 13;
  return o;
}

TEST(Autoware, MetadataThereAndBack) {
  const auto m = parse_autoware_metadata(
      "x_resolution: 100.0\ny_resolution: 150.0\nA.pcd: [1200, 2500] # -> 1200 < x\nB.pcd: [-1300, 0]\n");
  ASSERT_TRUE(m.ok()) << m.error().to_string();
  EXPECT_EQ(m->x_resolution_m, 100);
  EXPECT_EQ(m->y_resolution_m, 150);
  ASSERT_EQ(m->tiles.size(), 2u);
  EXPECT_EQ(m->tiles[1].file, "B.pcd");
  EXPECT_EQ(m->tiles[1].x, -1300);
  EXPECT_EQ(format_autoware_metadata(*m),
            "x_resolution: 100.0\ny_resolution: 150.0\nA.pcd: [1200, 2500]\nB.pcd: [-1300, 0]\n");
}

TEST(Autoware, MetadataThatIsNone) {
  const auto fails = [](const std::string& text) { return !parse_autoware_metadata(text).ok(); };
  EXPECT_TRUE(fails(""));
  EXPECT_TRUE(fails("[1, 2"));
  EXPECT_TRUE(fails("x_resolution: 1\ny_resolution: 1\n"));
  EXPECT_TRUE(fails("x_resolution: 1\na.pcd: [0, 0]\n"));
  EXPECT_TRUE(fails("x_resolution: 1\ny_resolution: -1\na.pcd: [0, 0]\n"));
  EXPECT_TRUE(fails("x_resolution: 1\ny_resolution: 1\na.pcd: [0]\n"));
  EXPECT_TRUE(fails("x_resolution: 1\ny_resolution: 1\na.pcd: [0, x]\n"));
  EXPECT_TRUE(fails("x_resolution: 1\ny_resolution: 1\n../a.pcd: [0, 0]\n"));
  EXPECT_TRUE(fails(std::string(100000, '[')));
  EXPECT_TRUE(fails(std::string(100000, '-')));
}

TEST(Autoware, RoundTrip) {
  const Folder folder;
  const PointCloud cloud = street(20000);
  ASSERT_TRUE(write_cloud(folder / "street.pcd", cloud).ok());
  const std::string first = folder / "a.mapc", second = folder / "b.mapc";
  ASSERT_TRUE(compress_files({folder / "street.pcd"}, first, lossless()).ok());
  const auto report = export_autoware(first, folder / "map", {}, std::nullopt, {}, {});
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  EXPECT_EQ(report->points, cloud.size());
  EXPECT_EQ(report->tiles, 20u);  // x: -40 to 60, y: -40 to 40
  EXPECT_TRUE(report->warnings.empty());
  EXPECT_EQ(detect_format(folder / "map").value(), "Autoware");

  const ReadBack back = drain(open_source(folder / "map"));
  ASSERT_TRUE(back.status.ok()) << message(back);
  EXPECT_EQ(back.cloud.coordinates.kind, CoordinateFormat::Kind::f32);
  EXPECT_EQ(hash_of(back.cloud), hash_of(cloud));
  const ReadBack tile = drain(open_source(folder / "map/pointcloud_map.pcd/-20_20.pcd"));
  ASSERT_GT(tile.cloud.size(), 0u) << message(tile);
  for (const Vec3& p : tile.cloud.xyz) EXPECT_TRUE(p[0] >= -20 && p[0] < 0 && p[1] >= 20 && p[1] < 40);

  ASSERT_TRUE(compress_files({folder / "map"}, second, lossless()).ok());
  EXPECT_EQ(hash_of(MapFile::open(second)->read().value()), hash_of(cloud));
}

TEST(Autoware, RegionsSizesAndPlaces) {
  const Folder folder;
  ASSERT_TRUE(write_cloud(folder / "street.pcd", street(5000)).ok());
  const std::string map = folder / "a.mapc";
  ASSERT_TRUE(compress_files({folder / "street.pcd"}, map, lossless()).ok());
  AutowareExport options;
  options.tile_size_m = 50;
  Region region;
  region.box = Box{{0, 0, 0}, {10, 10, 10}};
  ASSERT_TRUE(export_autoware(map, folder / "part", region, std::nullopt, {}, options).ok());
  const ReadBack part = drain(open_source(folder / "part"));
  EXPECT_EQ(part.cloud.size(), MapFile::open(map)->read(region).value().size());
  EXPECT_EQ(export_autoware(map, folder / "part", {}, std::nullopt, {}, options).error().code,
            ErrorCode::kCannotWrite);
  options.overwrite = true;
  EXPECT_TRUE(export_autoware(map, folder / "part", {}, std::nullopt, {}, options).ok());
  EXPECT_EQ(drain(open_source(folder / "part")).cloud.size(), 5000u);
  EXPECT_EQ(export_autoware(map, folder / "street.pcd", {}, std::nullopt, {}, options).error().code,
            ErrorCode::kCannotWrite);
  options.tile_size_m = 2.5;
  EXPECT_EQ(export_autoware(map, folder / "half", {}, std::nullopt, {}, options).error().code,
            ErrorCode::kInvalidArgument);
  region.box = Box{{1000, 0, 0}, {1001, 1, 1}};
  options.tile_size_m = 20;
  EXPECT_EQ(export_autoware(map, folder / "none", region, std::nullopt, {}, options).error().code,
            ErrorCode::kEmpty);
  EXPECT_EQ(folder.files(), 3u);  // nothing half written
}

TEST(Autoware, MissingAndUnlikeTiles) {
  const Folder folder;
  write_bytes(folder / "pointcloud_map_metadata.yaml",
              "x_resolution: 20\ny_resolution: 20\na.pcd: [0, 0]\nb.pcd: [20, 0]\n");
  ASSERT_TRUE(write_cloud(folder / "a.pcd", street(10)).ok());
  EXPECT_TRUE(fails_with(drain(open_source(folder / ".")), ErrorCode::kNotFound, "b.pcd"));
  PointCloud plain = street(10);
  plain.channels.clear();
  ASSERT_TRUE(write_cloud(folder / "b.pcd", plain).ok());
  EXPECT_TRUE(fails_with(drain(open_source(folder / ".")), ErrorCode::kInvalidArgument, "b.pcd"));
  ASSERT_TRUE(write_cloud(folder / "b.pcd", street(10)).ok());
  EXPECT_EQ(drain(open_source(folder / ".")).cloud.size(), 20u);
}

}  // namespace
}  // namespace mapcodec
