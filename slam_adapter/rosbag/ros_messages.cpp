// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/ros_messages.hpp"

#include "mapcodec/base/byte_reader.hpp"

namespace mapcodec {
namespace {

std::string text(ByteReader& in) {
  const ByteSpan v = in.raw(in.u32());
  return {v.begin(), v.end()};
}

std::string frame_name(ByteReader& in) {
  std::string r = text(in);
  if (r.starts_with('/')) r.erase(0, 1);
  return r;
}

RosHeader header(ByteReader& in) {
  RosHeader r;
  in.u32();  // sequence
  const std::uint32_t seconds = in.u32(), nanoseconds = in.u32();
  r.stamp_ns = std::int64_t{seconds} * 1'000'000'000 + nanoseconds;
  r.frame = frame_name(in);
  return r;
}

ScanPose pose(ByteReader& in) {
  ScanPose r;
  for (double& v : r.translation_m) v = in.f64();
  for (double& v : r.rotation_xyzw) v = in.f64();
  return r;
}

bool scalar_of(std::uint8_t datatype, ScalarType& scalar) {
  constexpr ScalarType kTypes[] = {ScalarType::i8,  ScalarType::u8,  ScalarType::i16, ScalarType::u16,
                                   ScalarType::i32, ScalarType::u32, ScalarType::f32, ScalarType::f64};
  if (datatype < 1 || datatype > 8) return false;
  scalar = kTypes[datatype - 1];
  return true;
}

Status malformed(const std::string& what) {
  return make_error(ErrorCode::kMalformed, "a PointCloud2 " + what);
}

Status read_fields(ByteReader& in, RosCloud& cloud) {
  const std::uint32_t count = in.u32();
  if (count > in.left() / 13) return malformed("announces more fields than it has bytes for");
  for (std::uint32_t i = 0; i < count; ++i) {
    RecordField f;
    f.name = text(in);
    f.offset = in.u32();
    const std::uint8_t datatype = in.u8();
    f.components = std::max<std::uint32_t>(1, in.u32());  // some drivers write 0
    if (!in.ok()) break;
    if (!scalar_of(datatype, f.scalar))
      return malformed("has the field " + f.name + " of the unknown type " + std::to_string(datatype));
    cloud.fields.push_back(std::move(f));
  }
  return {};
}

Status check(const RosCloud& c) {
  for (const RecordField& f : c.fields) {
    const std::uint64_t bytes = std::uint64_t{f.components} * scalar_size(f.scalar);
    if (f.components > c.point_step || f.offset + bytes > c.point_step)
      return malformed("has the field " + f.name + " beyond the end of its points");
  }
  const std::uint64_t points = std::uint64_t{c.width} * c.height;
  if (points == 0) return {};
  if (c.point_step == 0) return malformed("has points of 0 bytes");
  const std::uint64_t row = std::uint64_t{c.width} * c.point_step;
  if (c.height > 1 && c.row_step < row) return malformed("has rows that overlap");
  const std::uint64_t needed = std::uint64_t{c.height - 1} * c.row_step + row;
  if (needed > c.data.size()) {
    return malformed("announces " + std::to_string(points) + " points and holds " +
                     std::to_string(c.data.size()) + " of their " + std::to_string(needed) + " bytes");
  }
  return {};
}

}  // namespace

Result<std::vector<RosTransform>> read_transforms(ByteSpan message, std::uint64_t& broken) {
  ByteReader in(message);
  std::vector<RosTransform> r;
  const std::uint32_t count = in.u32();
  for (std::uint32_t i = 0; i < count && in.ok(); ++i) {
    RosTransform t;
    t.header = header(in);
    t.child = frame_name(in);
    t.pose = pose(in);
    if (!in.ok()) break;
    if (normalize(t.pose))
      r.push_back(std::move(t));
    else
      ++broken;
  }
  MAPCODEC_TRY(in.status("a message of transforms"));
  return r;
}

Result<std::optional<RosTransform>> read_odometry(ByteSpan message) {
  ByteReader in(message);
  RosTransform r;
  r.header = header(in);
  r.child = frame_name(in);
  r.pose = pose(in);
  MAPCODEC_TRY(in.status("a message of odometry"));
  return normalize(r.pose) ? std::optional(std::move(r)) : std::nullopt;
}

Result<RosCloud> read_cloud(ByteSpan message) {
  ByteReader in(message);
  RosCloud r;
  r.header = header(in);
  r.height = in.u32();
  r.width = in.u32();
  MAPCODEC_TRY(read_fields(in, r));
  r.big_endian = in.u8() != 0;
  r.point_step = in.u32();
  r.row_step = in.u32();
  r.data = in.raw(in.u32());
  MAPCODEC_TRY(in.status("a PointCloud2"));
  MAPCODEC_TRY(check(r));
  return r;
}

}  // namespace mapcodec
