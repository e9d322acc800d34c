// SPDX-License-Identifier: GPL-3.0-or-later
// Writes ROS 1 bags and the messages in them, byte by byte as the format's description says.
#pragma once

#include <bzlib.h>
#include <lz4frame.h>

#include <string>
#include <vector>

#include "mapcodec/base/byte_writer.hpp"
#include "slam_adapter/rosbag/scan_pose.hpp"

namespace mapcodec::rosbag_test {

inline void put_u32(std::string& to, std::uint32_t v) {
  for (int i = 0; i < 4; ++i) to.push_back(static_cast<char>(v >> (8 * i)));
}
inline void put_text(std::string& to, const std::string& text) {
  put_u32(to, static_cast<std::uint32_t>(text.size()));
  to += text;
}
template <class T>
void put(std::string& to, T v) {
  to.append(reinterpret_cast<const char*>(&v), sizeof(T));
}

/// A record's header field.
template <class T>
void put_field(std::string& to, const std::string& name, T v) {
  std::string field = name + "=";
  put(field, v);
  put_text(to, field);
}
inline void put_field(std::string& to, const std::string& name, const std::string& v) {
  put_text(to, name + "=" + v);
}

struct Message {
  std::string topic, type;
  std::int64_t time_ns = 0;
  std::string bytes;
};

class BagWriter {
 public:
  explicit BagWriter(std::string compression = "none") : compression_(std::move(compression)) {}

  /// All in one chunk.
  void add_chunk(const std::vector<Message>& messages) {
    std::string inner, index;
    std::vector<std::string> indexed;
    for (const Message& m : messages) {
      const std::uint32_t c = connection(m, inner);
      std::string header;
      put_field(header, "op", std::uint8_t{2});
      put_field(header, "conn", c);
      put_field(header, "time", time(m.time_ns));
      record(inner, header, m.bytes);
      std::string entry;
      put_field(entry, "op", std::uint8_t{4});
      put_field(entry, "conn", c);
      put_field(entry, "ver", std::uint32_t{1});
      put_field(entry, "count", std::uint32_t{0});
      record(index, entry, "");
    }
    std::string header;
    put_field(header, "op", std::uint8_t{5});
    put_field(header, "compression", compression_);
    put_field(header, "size", static_cast<std::uint32_t>(inner.size()));
    record(body_, header, packed(inner));
    body_ += index;
  }
  /// @param with_index  false: as of a recorder that was killed.
  [[nodiscard]] std::string finish(bool with_index = true) const {
    std::string header;
    put_field(header, "op", std::uint8_t{3});
    put_field(header, "index_pos", std::uint64_t{0});
    put_field(header, "conn_count", static_cast<std::uint32_t>(connections_.size()));
    put_field(header, "chunk_count", std::uint32_t{1});
    std::string r = "#ROSBAG V2.0\n";
    record(r, header, std::string(4096 - 8 - header.size(), ' '));
    return r + body_ + (with_index ? records_ : std::string());
  }

 private:
  static void record(std::string& to, const std::string& header, const std::string& data) {
    put_text(to, header);
    put_text(to, data);
  }
  static std::uint64_t time(std::int64_t ns) {
    return static_cast<std::uint64_t>(ns / 1'000'000'000) | static_cast<std::uint64_t>(ns % 1'000'000'000)
                                                                << 32;
  }
  std::uint32_t connection(const Message& m, std::string& inner) {
    for (std::size_t i = 0; i < connections_.size(); ++i) {
      if (connections_[i] == m.topic) return static_cast<std::uint32_t>(i);
    }
    const auto number = static_cast<std::uint32_t>(connections_.size());
    connections_.push_back(m.topic);
    std::string header, data, whole;
    put_field(header, "op", std::uint8_t{7});
    put_field(header, "conn", number);
    put_field(header, "topic", m.topic);
    put_field(data, "topic", m.topic);
    put_field(data, "type", m.type);
    put_field(data, "md5sum", std::string(32, '0'));
    put_field(data, "message_definition", std::string("none"));
    record(whole, header, data);
    inner += whole;
    records_ += whole;
    return number;
  }
  [[nodiscard]] std::string packed(std::string data) const {
    if (compression_ == "lz4") {
      std::string r(LZ4F_compressFrameBound(data.size(), nullptr), '\0');
      r.resize(LZ4F_compressFrame(r.data(), r.size(), data.data(), data.size(), nullptr));
      return r;
    }
    if (compression_ == "bz2") {
      std::string r(data.size() * 2 + 1000, '\0');
      auto size = static_cast<unsigned>(r.size());
      BZ2_bzBuffToBuffCompress(r.data(), &size, data.data(), static_cast<unsigned>(data.size()), 1, 0, 0);
      r.resize(size);
      return r;
    }
    return data;
  }

  std::string compression_, body_, records_;
  std::vector<std::string> connections_;
};

inline void put_header(std::string& to, std::int64_t stamp_ns, const std::string& frame) {
  put_u32(to, 7);
  put_u32(to, static_cast<std::uint32_t>(stamp_ns / 1'000'000'000));
  put_u32(to, static_cast<std::uint32_t>(stamp_ns % 1'000'000'000));
  put_text(to, frame);
}
inline void put_pose(std::string& to, const ScanPose& pose) {
  for (const double v : pose.translation_m) put(to, v);
  for (const double v : pose.rotation_xyzw) put(to, v);
}

struct Transform {
  std::string parent, child;
  std::int64_t stamp_ns = 0;
  ScanPose pose;
};
inline Message tf(const std::vector<Transform>& transforms, bool is_static = false) {
  Message m{is_static ? "/tf_static" : "/tf", "tf2_msgs/TFMessage", transforms.front().stamp_ns, ""};
  put_u32(m.bytes, static_cast<std::uint32_t>(transforms.size()));
  for (const Transform& t : transforms) {
    put_header(m.bytes, t.stamp_ns, t.parent);
    put_text(m.bytes, t.child);
    put_pose(m.bytes, t.pose);
  }
  return m;
}
inline Message odometry(const Transform& t) {
  Message m{"/odom", "nav_msgs/Odometry", t.stamp_ns, ""};
  put_header(m.bytes, t.stamp_ns, t.parent);
  put_text(m.bytes, t.child);
  put_pose(m.bytes, t.pose);
  m.bytes += std::string(36 * 8 + 48 + 36 * 8, '\0');
  return m;
}

struct Field {
  std::string name;
  std::uint32_t offset = 0;
  std::uint8_t datatype = 7;  ///< FLOAT32
  std::uint32_t count = 1;
};
struct Cloud {
  std::string topic = "/points", frame = "lidar";
  std::int64_t stamp_ns = 0;
  std::uint32_t width = 0, height = 1, point_step = 12, padding = 0;
  bool big_endian = false;
  std::vector<Field> fields{{"x", 0}, {"y", 4}, {"z", 8}};
  std::string data;  ///< with the padding
};
inline Message cloud(const Cloud& c) {
  Message m{c.topic, "sensor_msgs/PointCloud2", c.stamp_ns, ""};
  put_header(m.bytes, c.stamp_ns, c.frame);
  put_u32(m.bytes, c.height);
  put_u32(m.bytes, c.width);
  put_u32(m.bytes, static_cast<std::uint32_t>(c.fields.size()));
  for (const Field& f : c.fields) {
    put_text(m.bytes, f.name);
    put_u32(m.bytes, f.offset);
    m.bytes.push_back(static_cast<char>(f.datatype));
    put_u32(m.bytes, f.count);
  }
  m.bytes.push_back(c.big_endian ? 1 : 0);
  put_u32(m.bytes, c.point_step);
  put_u32(m.bytes, c.width * c.point_step + c.padding);
  put_text(m.bytes, c.data);
  m.bytes.push_back(1);
  return m;
}
/// x, y, z as float32.
inline Cloud xyz_cloud(const std::vector<std::array<float, 3>>& points, std::int64_t stamp_ns) {
  Cloud c;
  c.stamp_ns = stamp_ns;
  c.width = static_cast<std::uint32_t>(points.size());
  for (const auto& p : points) {
    for (const float v : p) put(c.data, v);
  }
  return c;
}

/// A robot that drives one metre a second along x, its lidar turned by 90 degrees about z and one metre up,
/// and a scan of two points at each half second.
inline std::string driving_bag(const std::string& compression, bool with_index = true) {
  constexpr std::int64_t kStart = 1'700'000'000'000'000'000, kHalf = 500'000'000;
  const double r = std::sqrt(0.5);
  BagWriter bag(compression);
  bag.add_chunk({tf({{"base_link", "lidar", kStart, {{0, 0, 1}, {0, 0, r, r}}}}, true)});
  std::vector<Message> messages;
  for (int i = 0; i < 4; ++i) {
    const Transform t{"odom", "base_link", kStart + 2 * i * kHalf, {{1.0 * i, 0, 0}, {0, 0, 0, 1}}};
    messages.push_back(tf({t}));
    messages.push_back(odometry({"world", "base_link", t.stamp_ns, {{10.0 + i, 0, 0}, {0, 0, 0, 1}}}));
  }
  bag.add_chunk(messages);
  messages.clear();
  for (int i = 0; i < 7; ++i)
    messages.push_back(cloud(xyz_cloud({{1, 0, 0}, {0, 2, float(i)}}, kStart + i * kHalf)));
  bag.add_chunk(messages);
  return bag.finish(with_index);
}

}  // namespace mapcodec::rosbag_test
