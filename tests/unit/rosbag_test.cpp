// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>

#include "slam_adapter/rosbag/bag_scans.hpp"
#include "slam_adapter/rosbag/frame_tree.hpp"
#include "tests/unit/formats_support.hpp"
#include "tests/unit/rosbag_support.hpp"

namespace mapcodec {
namespace {

using namespace formats_test;
using namespace rosbag_test;

ReadBack read_bag(const std::string& bytes, const BagOptions& options = {}) {
  ReadOptions read;
  read.bag = options;
  return read_text(bytes, "drive.bag", read);
}

BagOptions poses(BagOptions::Poses p, const std::string& frame = "") {
  BagOptions o;
  o.poses = p;
  o.frame = frame;
  return o;
}

void expect_near(const Vec3& a, const Vec3& b) {
  for (std::size_t d = 0; d < 3; ++d) EXPECT_NEAR(a[d], b[d], 1e-9) << "axis " << d;
}

std::string one_cloud(const Cloud& c) {
  BagWriter bag;
  bag.add_chunk({cloud(c)});
  return bag.finish();
}

TEST(RosBag, TfPutsScansWhereTheyWere) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    const ReadBack r = read_bag(driving_bag(compression));
    ASSERT_TRUE(r.status.ok()) << compression << ": " << message(r);
    ASSERT_EQ(r.cloud.size(), 14u);
    EXPECT_EQ(r.cloud.coordinates.kind, CoordinateFormat::Kind::f64);
    for (int i = 0; i < 7; ++i) {  // every second scan lies between two transforms
      expect_near(r.cloud.xyz[std::size_t(2 * i)], {0.5 * i, 1, 1});
      expect_near(r.cloud.xyz[std::size_t(2 * i + 1)], {0.5 * i - 2, 0, 1.0 + i});
    }
  }
}

TEST(RosBag, OdometryFramesAndNone) {
  const std::string bag = driving_bag("none");
  const ReadBack odometry = read_bag(bag, poses(BagOptions::Poses::odometry));
  ASSERT_EQ(odometry.cloud.size(), 14u) << message(odometry);
  expect_near(odometry.cloud.xyz[2], {10.5, 1, 1});
  const ReadBack none = read_bag(bag, poses(BagOptions::Poses::none));
  ASSERT_EQ(none.cloud.size(), 14u);
  EXPECT_EQ(none.cloud.coordinates.kind, CoordinateFormat::Kind::f32);
  expect_near(none.cloud.xyz[2], {1, 0, 0});
  const ReadBack base = read_bag(bag, poses(BagOptions::Poses::tf, "base_link"));
  ASSERT_EQ(base.cloud.size(), 14u);
  expect_near(base.cloud.xyz[4], {0, 1, 1});
  EXPECT_TRUE(
      fails_with(read_bag(bag, poses(BagOptions::Poses::tf, "moon")), ErrorCode::kEmpty, "--poses none"));
}

TEST(RosBag, PosesThatAreNoneAreLeftOutAndCounted) {
  BagWriter bag;
  const Transform good{"odom", "lidar", 1000, {{5, 0, 0}, {0, 0, 0, 1}}};
  Transform bad = good;
  bad.pose.rotation_xyzw = {0, 0, 0, 0};
  bag.add_chunk({tf({good, bad}), odometry(bad), odometry(good), cloud(xyz_cloud({{1, 2, 3}}, 1000))});
  for (const auto p : {BagOptions::Poses::tf, BagOptions::Poses::odometry}) {
    const ReadBack r = read_bag(bag.finish(), poses(p));
    ASSERT_EQ(r.cloud.size(), 1u) << message(r);
    expect_near(r.cloud.xyz[0], {6, 2, 3});
    ASSERT_FALSE(r.warnings.empty());
    EXPECT_NE(r.warnings.front().find("left out"), std::string::npos) << r.warnings.front();
  }
}

TEST(RosBag, WithoutIndexTheChunksTell) {
  const ReadBack r = read_bag(driving_bag("lz4", false));
  ASSERT_EQ(r.cloud.size(), 14u) << message(r);
  ASSERT_FALSE(r.warnings.empty());
  EXPECT_NE(r.warnings.front().find("no index"), std::string::npos);
}

TEST(RosBag, ScansOneByOneAndAgain) {
  const std::string bytes = driving_bag("lz4");
  auto scans = BagScans::open(
      memory_stream(ByteSpan(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size())), {});
  ASSERT_TRUE(scans.ok());
  for (int round = 0; round < 2; ++round) {
    BagScan scan;
    int n = 0;
    while ((*scans)->next(scan).value()) {
      EXPECT_EQ(scan.topic, "/points");
      EXPECT_EQ(scan.frame, "lidar");
      EXPECT_EQ(scan.stamp_ns, 1'700'000'000'000'000'000 + n * 500'000'000ll);
      ASSERT_TRUE(scan.T_map_sensor);
      EXPECT_NEAR(scan.T_map_sensor->translation_m[0], 0.5 * n, 1e-9);
      EXPECT_EQ(scan.points.size(), 2u);
      ++n;
    }
    EXPECT_EQ(n, 7);
    (*scans)->rewind();
  }
}

TEST(RosBag, EveryTypeEveryEndPaddingAndColour) {
  for (const bool big : {false, true}) {
    Cloud c;
    c.fields = {{"x", 0, 8},  {"y", 8, 3},        {"z", 12, 7},  {"rgb", 16, 7}, {"ring", 20, 4},
                {"t", 24, 6}, {"hist", 28, 2, 3}, {"i8", 31, 1}, {"i32", 32, 5}};
    c.point_step = 40;
    c.width = 2;
    c.height = 2;
    c.padding = 5;
    c.big_endian = big;
    const auto add = [&](auto v) {
      std::string bytes;
      put(bytes, v);
      if (big) std::reverse(bytes.begin(), bytes.end());
      c.data += bytes;
    };
    for (int i = 0; i < 4; ++i) {
      add(100.25 + i);
      add(std::int16_t(-i));
      c.data += "..";
      add(float(i) / 2);
      add(std::uint32_t(0x80010203 + i));
      add(std::uint16_t(1000 + i));
      c.data += "..";
      add(std::uint32_t(4'000'000'000u + i));
      for (int k = 0; k < 3; ++k) c.data.push_back(static_cast<char>(10 * k + i));
      add(std::int8_t(-100 + i));
      add(std::int32_t(-70000 - i));
      c.data += "....";
      if (i == 1) c.data += "#####";
    }
    const ReadBack r = read_bag(one_cloud(c));
    ASSERT_EQ(r.cloud.size(), 4u) << message(r);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(r.cloud.xyz[i], (Vec3{100.25 + double(i), -double(i), double(i) / 2}));
      EXPECT_EQ(r.cloud.find("ring")->get<std::uint16_t>(i), 1000 + i);
      EXPECT_EQ(r.cloud.find("t")->get<std::uint32_t>(i), 4'000'000'000u + i);
      EXPECT_EQ(r.cloud.find("hist")->get<std::uint8_t>(i, 2), 20 + i);
      EXPECT_EQ(r.cloud.find("i8")->get<std::int8_t>(i), -100 + int(i));
      EXPECT_EQ(r.cloud.find("i32")->get<std::int32_t>(i), -70000 - int(i));
      EXPECT_EQ(r.cloud.find("rgb")->get<std::uint8_t>(i, 0), 1);
      EXPECT_EQ(r.cloud.find("rgb")->get<std::uint8_t>(i, 2), 3 + i);
      EXPECT_EQ(r.cloud.find("alpha")->get<std::uint8_t>(i), 0x80);
    }
    ASSERT_FALSE(r.warnings.empty());  // neither tf nor odometry
  }
}

/// Seen by a lidar that is turned by 90 degrees about z: a normal along x, in the fields given.
std::string bag_with_normals(const std::vector<Field>& fields, const std::string& values) {
  constexpr std::int64_t kTime = 1'700'000'000'000'000'000;
  const double r = std::sqrt(0.5);
  Cloud c;
  c.stamp_ns = kTime;
  c.width = 1;
  for (int i = 0; i < 3; ++i) put(c.data, 1.0F);
  c.data += values;
  c.point_step = static_cast<std::uint32_t>(c.data.size());
  c.fields.insert(c.fields.end(), fields.begin(), fields.end());
  BagWriter bag;
  bag.add_chunk({tf({{"map", "lidar", kTime, {{0, 0, 0}, {0, 0, r, r}}}}, true), cloud(c)});
  return bag.finish();
}

TEST(RosBag, NormalsOfFloatsAndDoublesTurn) {
  std::string floats, doubles;
  for (const float v : {1.0F, 0.0F, 0.0F}) put(floats, v);
  for (const double v : {1.0, 0.0, 0.0}) put(doubles, v);
  const std::vector<std::pair<std::vector<Field>, std::string>> forms = {
      {{{"normal_x", 12, 7}, {"normal_y", 16, 7}, {"normal_z", 20, 7}}, floats},
      {{{"normal_x", 12, 8}, {"normal_y", 20, 8}, {"normal_z", 28, 8}}, doubles},
      {{{"nx", 12, 8}, {"ny", 20, 8}, {"nz", 28, 8}}, doubles},
      {{{"normal", 12, 8, 3}}, doubles}};
  for (const auto& [fields, values] : forms) {
    const ReadBack r = read_bag(bag_with_normals(fields, values));
    ASSERT_EQ(r.cloud.size(), 1u) << message(r);
    const Channel* normal = r.cloud.find("normal");
    ASSERT_NE(normal, nullptr) << fields.front().name;
    ASSERT_EQ(normal->info.components, 3);
    const bool wide = normal->info.scalar == ScalarType::f64;
    for (std::size_t d = 0; d < 3; ++d) {
      const double v = wide ? normal->get<double>(0, d) : double(normal->get<float>(0, d));
      EXPECT_NEAR(v, d == 1 ? 1 : 0, wide ? 1e-12 : 1e-6) << fields.front().name;
    }
    for (const std::string& w : r.warnings) EXPECT_EQ(w.find("stays as it is"), std::string::npos) << w;
  }
}

TEST(RosBag, NormalsThatDoNotTurnAreNamed) {
  const ReadBack r = read_bag(bag_with_normals({{"normal", 12, 1, 3}}, std::string("\x7f\0\0", 3)));
  ASSERT_EQ(r.cloud.size(), 1u) << message(r);
  EXPECT_EQ(r.cloud.find("normal")->get<std::int8_t>(0, 0), 127);
  EXPECT_TRUE(std::any_of(r.warnings.begin(), r.warnings.end(), [](const std::string& w) {
    return w.find("the channel normal stays as it is") != std::string::npos;
  }));
}

TEST(RosBag, NanAreDroppedAndCounted) {
  const ReadBack r = read_bag(one_cloud(xyz_cloud({{1, 2, 3}, {NAN, 0, 0}, {4, 5, 6}}, 5)));
  EXPECT_EQ(r.cloud.size(), 2u);
  EXPECT_EQ(r.dropped, 1u);
}

TEST(RosBag, TopicsAreChosenAndJoined) {
  BagWriter bag;
  Cloud a = xyz_cloud({{1, 2, 3}}, 5), b = xyz_cloud({{4, 5, 6}}, 6);
  b.topic = "/rear";
  b.point_step = 16;
  b.fields.push_back({"intensity", 12});
  put(b.data, 7.0f);
  bag.add_chunk({cloud(a), cloud(b)});
  const std::string bytes = bag.finish();
  const ReadBack both = read_bag(bytes);
  EXPECT_EQ(both.cloud.size(), 2u);
  EXPECT_TRUE(both.cloud.channels.empty());
  BagOptions one;
  one.topics = {"/rear"};
  const ReadBack rear = read_bag(bytes, one);
  ASSERT_EQ(rear.cloud.size(), 1u);
  EXPECT_EQ(rear.cloud.find("intensity")->get<float>(0), 7.0f);
  one.topics = {"/front"};
  EXPECT_TRUE(fails_with(read_bag(bytes, one), ErrorCode::kInvalidArgument, "/points, /rear"));
}

TEST(RosBag, BadMessagesAndBags) {
  const auto bad = [](auto change) {
    Cloud c = xyz_cloud({{1, 2, 3}, {4, 5, 6}}, 5);
    change(c);
    return read_bag(one_cloud(c));
  };
  EXPECT_TRUE(fails_with(bad([](Cloud& c) { c.width = 3; }), ErrorCode::kMalformed, "announces 3 points"));
  EXPECT_TRUE(
      fails_with(bad([](Cloud& c) { c.fields[2].offset = 9; }), ErrorCode::kMalformed, "beyond the end"));
  EXPECT_TRUE(
      fails_with(bad([](Cloud& c) { c.fields[2].datatype = 9; }), ErrorCode::kMalformed, "unknown type 9"));
  EXPECT_TRUE(fails_with(bad([](Cloud& c) { c.fields.pop_back(); }), ErrorCode::kMalformed, "no field z"));
  EXPECT_TRUE(
      fails_with(bad([](Cloud& c) { c.fields[2].count = 0x40000000; }), ErrorCode::kMalformed, "beyond"));
  BagWriter empty;
  EXPECT_TRUE(fails_with(read_bag(empty.finish()), ErrorCode::kEmpty, "no message"));
  BagWriter other;
  other.add_chunk({odometry({"a", "b", 1, {}})});
  EXPECT_TRUE(fails_with(read_bag(other.finish()), ErrorCode::kEmpty, "/odom (nav_msgs/Odometry)"));
  EXPECT_TRUE(fails_with(read_bag("#ROSBAG V1.2\n"), ErrorCode::kUnsupported, "format 2.0"));
  EXPECT_TRUE(fails_with(read_bag("\x89MCAP0\r\n whatever"), ErrorCode::kUnsupported, "rosbags-convert"));
  EXPECT_TRUE(fails_with(read_bag(driving_bag("zip")), ErrorCode::kUnsupported, "'zip'"));
}

TEST(RosBag, CutAnywhereIsAnErrorOrFewerScans) {
  const std::string whole = driving_bag("none");
  for (std::size_t size = 0; size < whole.size(); size += size < 4096 ? 97 : 5) {
    const ReadBack r = read_bag(whole.substr(0, size));
    EXPECT_TRUE(!r.status.ok() || r.cloud.size() <= 14) << size;
  }
}

TEST(RosBag, FlippedBytesNeverCrash) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    std::string bytes = driving_bag(compression);
    for (std::size_t i = 0; i < bytes.size(); i += i < 4000 && i > 100 ? 301 : 3) {
      for (const int flip : {0x01, 0x80, 0xff}) {
        bytes[i] = static_cast<char>(bytes[i] ^ flip);
        (void)read_bag(bytes);
        bytes[i] = static_cast<char>(bytes[i] ^ flip);
      }
    }
  }
}

TEST(FrameTree, InterpolatesTurnsBothWaysRound) {
  FrameTree tree;
  const auto about_z = [](double angle) {
    return ScanPose{{0, 0, 0}, {0, 0, std::sin(angle / 2), std::cos(angle / 2)}};
  };
  tree.add({{0, "map"}, "base", about_z(0)}, false);
  ScanPose turned = about_z(1.0);
  for (double& v : turned.rotation_xyzw) v = -v;  // the same rotation
  tree.add({{1000, "map"}, "base", turned}, false);
  tree.add({{0, "map"}, "station", {{5, 0, 0}, {0, 0, 0, 1}}}, true);
  tree.sort();
  const auto half = tree.lookup("map", "base", 500);
  ASSERT_TRUE(half);
  expect_near(half->apply({1, 0, 0}), {std::cos(0.5), std::sin(0.5), 0});
  expect_near(tree.lookup("station", "base", 0)->apply({0, 0, 0}), {-5, 0, 0});
  expect_near(tree.lookup("base", "station", 1000)->apply({0, 0, 0}),
              {5 * std::cos(1.0), -5 * std::sin(1.0), 0});
  EXPECT_FALSE(tree.lookup("map", "base", 200'000'000));
  EXPECT_FALSE(tree.lookup("map", "unknown", 0));
}

TEST(FrameTree, LoopsEnd) {
  FrameTree tree;
  tree.add({{0, "a"}, "b", {}}, true);
  tree.add({{0, "b"}, "a", {}}, true);
  tree.sort();
  EXPECT_FALSE(tree.lookup("map", "a", 0));
  (void)tree.root_of("a");
}

}  // namespace
}  // namespace mapcodec
