// SPDX-License-Identifier: GPL-3.0-or-later
// Bags as ROS's own storage library writes and reads them.
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include "slam_adapter/rosbag/bag_file.hpp"
#include "slam_adapter/rosbag/ros_messages.hpp"
#include "tests/unit/formats_support.hpp"
#include "tests/unit/rosbag_support.hpp"

namespace {

/// A message that is bytes already.
struct Raw {
  std::string bytes, type;
};

}  // namespace

namespace ros::serialization {
template <>
struct Serializer<Raw> {
  template <class Stream>
  static void write(Stream& stream, const Raw& raw) {
    std::copy(raw.bytes.begin(), raw.bytes.end(),
              stream.advance(static_cast<std::uint32_t>(raw.bytes.size())));
  }
  template <class Stream>
  static void read(Stream& stream, Raw& raw) {
    const std::uint32_t n = stream.getLength();
    raw.bytes.assign(reinterpret_cast<const char*>(stream.advance(n)), n);
  }
  static std::uint32_t serializedLength(const Raw& raw) {
    return static_cast<std::uint32_t>(raw.bytes.size());
  }
};
}  // namespace ros::serialization
namespace ros::message_traits {
template <>
struct MD5Sum<Raw> {
  static const char* value() { return "*"; }
  static const char* value(const Raw&) { return "*"; }
};
template <>
struct DataType<Raw> {
  static const char* value() { return "sensor_msgs/PointCloud2"; }
  static const char* value(const Raw& raw) { return raw.type.c_str(); }
};
template <>
struct Definition<Raw> {
  static const char* value() { return "none"; }
  static const char* value(const Raw&) { return "none"; }
};
}  // namespace ros::message_traits

namespace mapcodec {
namespace {

using namespace rosbag_test;

std::vector<Message> messages() {
  std::vector<Message> r;
  for (int i = 0; i < 300; ++i) {
    const std::int64_t t = 1'600'000'000'000'000'000 + i * 10'000'000ll;
    r.push_back(tf({{"odom", "base", t, {{0.1 * i, 0, 0}, {0, 0, 0, 1}}}}));
    std::vector<std::array<float, 3>> points(200, {float(i), 1, 2});
    r.push_back(cloud(xyz_cloud(points, t)));
  }
  return r;
}

TEST(RosBagOracle, ReadsWhatRosWrites) {
  const formats_test::Folder folder;
  const std::vector<Message> written = messages();
  for (const auto compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    const std::string path = folder / "ros.bag";
    {
      rosbag::Bag bag(path, rosbag::bagmode::Write);
      bag.setCompression(compression);
      bag.setChunkThreshold(100'000);
      for (const Message& m : written) {
        ros::Time t;
        t.fromNSec(static_cast<std::uint64_t>(m.time_ns));
        bag.write(m.topic, t, Raw{m.bytes, m.type});
      }
    }
    const auto stream = file_stream(path);
    ASSERT_TRUE(stream.ok());
    const auto bag = BagFile::open(**stream);
    ASSERT_TRUE(bag.ok()) << bag.error().to_string();
    std::set<std::uint32_t> all;
    for (const auto& [number, c] : bag->connections) all.insert(number);
    BagMessages reader(*bag, **stream, all);
    BagMessage m;
    for (const Message& expected : written) {
      const auto more = reader.next(m);
      ASSERT_TRUE(more.ok() && *more);
      EXPECT_EQ(bag->connections.at(m.connection).topic, expected.topic);
      EXPECT_EQ(bag->connections.at(m.connection).type, expected.type);
      EXPECT_EQ(m.time_ns, expected.time_ns);
      EXPECT_EQ(std::string(m.bytes.begin(), m.bytes.end()), expected.bytes);
    }
    EXPECT_FALSE(reader.next(m).value());
  }
}

}  // namespace
}  // namespace mapcodec
