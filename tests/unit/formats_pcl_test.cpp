// SPDX-License-Identifier: GPL-3.0-or-later
// PCL's own io library as the oracle: what it writes we read, what we write it reads, bit for bit.
#include <gtest/gtest.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>

#include <random>

#include "tests/unit/formats_support.hpp"

namespace mapcodec {
namespace {

using namespace formats_test;
using Cloud = pcl::PointCloud<pcl::PointXYZRGBNormal>;

Cloud make_pcl_cloud() {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(-1, 1);
  Cloud c;
  for (int i = 0; i < 3000; ++i) {
    pcl::PointXYZRGBNormal p;
    p.x = 100 * unit(random);
    p.y = 100 * unit(random);
    p.z = 10 * unit(random);
    p.r = static_cast<std::uint8_t>(random());
    p.g = static_cast<std::uint8_t>(random());
    p.b = static_cast<std::uint8_t>(random());
    p.a = 255;
    p.normal_x = unit(random);
    p.normal_y = unit(random);
    p.normal_z = unit(random);
    p.curvature = unit(random);
    c.push_back(p);
  }
  return c;
}

void expect_equal(const Cloud& theirs, const PointCloud& ours) {
  ASSERT_EQ(theirs.size(), ours.size());
  const Channel *rgb = ours.find("rgb"), *normal = ours.find("normal"), *curvature = ours.find("curvature");
  ASSERT_TRUE(rgb != nullptr && normal != nullptr && curvature != nullptr);
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const auto& p = theirs[i];
    ASSERT_EQ(ours.xyz[i], (Vec3{p.x, p.y, p.z})) << i;
    ASSERT_EQ(rgb->get<std::uint8_t>(i, 0), p.r) << i;
    ASSERT_EQ(rgb->get<std::uint8_t>(i, 1), p.g) << i;
    ASSERT_EQ(rgb->get<std::uint8_t>(i, 2), p.b) << i;
    ASSERT_EQ(normal->get<float>(i, 0), p.normal_x) << i;
    ASSERT_EQ(normal->get<float>(i, 2), p.normal_z) << i;
    ASSERT_EQ(curvature->get<float>(i), p.curvature) << i;
  }
}

TEST(PclOracle, WeReadWhatPclWrites) {
  Folder folder;
  const Cloud cloud = make_pcl_cloud();
  const std::string path = folder / "a.pcd";
  pcl::PCDWriter pcd;
  const auto check = [&](const std::string& file) {
    const auto r = drain(open_source(file));
    ASSERT_TRUE(r.status.ok()) << message(r);
    expect_equal(cloud, r.cloud);
  };
  ASSERT_EQ(pcd.writeBinary(path, cloud), 0);
  check(path);
  ASSERT_EQ(pcd.writeBinaryCompressed(path, cloud), 0);
  check(path);
  ASSERT_EQ(pcd.writeASCII(path, cloud, 9), 0);
  check(path);
}

TEST(PclOracle, WeReadPlyThatPclWrites) {
  Folder folder;
  const Cloud cloud = make_pcl_cloud();
  for (const bool binary : {true, false}) {
    const std::string path = folder / "a.ply";
    ASSERT_EQ(pcl::io::savePLYFile(path, cloud, binary), 0);
    const auto r = drain(open_source(path));
    ASSERT_TRUE(r.status.ok()) << message(r);
    ASSERT_EQ(r.cloud.size(), cloud.size());
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vec3 p{cloud[i].x, cloud[i].y, cloud[i].z};
      for (std::size_t d = 0; d < 3; ++d)
        ASSERT_NEAR(r.cloud.xyz[i][d], p[d], binary ? 0 : 1e-3) << i;  // PCL's text has 8 digits at most
      ASSERT_EQ(r.cloud.find("rgb")->get<std::uint8_t>(i, 1), cloud[i].g);
    }
  }
}

TEST(PclOracle, PclReadsWhatWeWrite) {
  Folder folder;
  const Cloud cloud = make_pcl_cloud();
  pcl::PCDWriter().writeBinary(folder / "in.pcd", cloud);
  const auto ours = drain(open_source(folder / "in.pcd"));
  ASSERT_TRUE(ours.status.ok()) << message(ours);
  for (const WriteOptions o :
       {WriteOptions{}, WriteOptions{.ascii = true}, WriteOptions{.compressed = true}}) {
    ASSERT_TRUE(write_cloud(folder / "out.pcd", ours.cloud, o).ok());
    Cloud back;
    ASSERT_EQ(pcl::io::loadPCDFile(folder / "out.pcd", back), 0);
    expect_equal(back, ours.cloud);
  }
  for (const bool ascii : {false, true}) {
    ASSERT_TRUE(write_cloud(folder / "out.ply", ours.cloud, {.ascii = ascii}).ok());
    Cloud back;
    ASSERT_EQ(pcl::io::loadPLYFile(folder / "out.ply", back), 0);
    expect_equal(back, ours.cloud);
  }
}

}  // namespace
}  // namespace mapcodec
