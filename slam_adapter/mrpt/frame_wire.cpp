// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/frame_wire.hpp"

#include "maps/submap_pose.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kMostClasses = 10000, kLongestText = 4096;

void write_pose(ByteWriter& out, const MapPose& p) {
  for (const double v : p.translation_m) out.f64(v);
  for (const double v : p.rotation_xyzw) out.f64(v);
}

MapPose read_pose(ByteReader& in) {
  MapPose p;
  for (double& v : p.translation_m) v = in.f64();
  for (double& v : p.rotation_xyzw) v = in.f64();
  return p;
}

void write_pose(ByteWriter& out, const std::optional<MapPose>& p) {
  out.u8(p ? 1 : 0);
  if (p) write_pose(out, *p);
}

std::optional<MapPose> read_optional_pose(ByteReader& in) {
  if (in.u8() == 0) return std::nullopt;
  return read_pose(in);
}

Status check(const std::optional<MapPose>& p) {
  return p ? check_pose(p->translation_m, p->rotation_xyzw) : Status{};
}

Error malformed(const char* what) {
  return make_error(ErrorCode::kMalformed, std::string("the reader's answer holds ") + what);
}

Result<std::string> read_text(ByteReader& in) {
  const ByteSpan v = in.sized();
  if (v.size() > kLongestText) return malformed("a name that is too long");
  return std::string(v.begin(), v.end());
}

void write_points(ByteWriter& out, const PointCloud& cloud) {
  out.varint(cloud.size());
  out.varint(cloud.channels.size());
  for (const Channel& c : cloud.channels) {
    out.text(c.info.name);
    out.u8(static_cast<std::uint8_t>(c.info.scalar));
    out.u8(c.info.components);
  }
  for (const Vec3& p : cloud.xyz) {
    for (const double v : p) out.f32(static_cast<float>(v));
  }
  for (const Channel& c : cloud.channels) out.raw(c.data);
}

Result<Channel> read_channel_info(ByteReader& in) {
  Channel c;
  MAPCODEC_ASSIGN(c.info.name, read_text(in));
  c.info.scalar = static_cast<ScalarType>(in.u8());
  c.info.components = in.u8();
  if (c.info.name.empty() || c.info.stride() == 0) return malformed("a channel that is none");
  return c;
}

Result<PointCloud> read_points(ByteReader& in) {
  PointCloud cloud;
  const std::uint64_t count = in.varint(), channels = in.varint();
  if (channels > DecodeLimits{}.max_channels) return malformed("too many channels");
  std::uint64_t stride = 12;
  for (std::uint64_t i = 0; i < channels && in.ok(); ++i) {
    MAPCODEC_ASSIGN(Channel c, read_channel_info(in));
    stride += c.info.stride();
    cloud.channels.push_back(std::move(c));
  }
  if (!in.ok() || count > in.left() / stride) return malformed("more points than bytes");
  cloud.xyz.resize(count);
  for (Vec3& p : cloud.xyz) {
    for (double& v : p) v = static_cast<double>(in.f32());
  }
  for (Channel& c : cloud.channels) {
    const ByteSpan data = in.raw(count * c.info.stride());
    c.data.assign(data.begin(), data.end());
  }
  return cloud;
}

}  // namespace

Bytes write_message(WireKind kind, ByteSpan payload) {
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(kind));
  out.u32(static_cast<std::uint32_t>(payload.size()));
  out.raw(payload);
  return out.take();
}

Bytes write_frame(const RawlogFrame& f) {
  ByteWriter out;
  out.varint(f.number);
  out.varint(f.group);
  out.text(f.class_name);
  out.text(f.sensor);
  out.u8(f.stamp_s ? 1 : 0);
  out.f64(f.stamp_s.value_or(0));
  write_pose(out, f.T_vehicle_sensor);
  write_pose(out, f.T_odom_vehicle);
  write_pose(out, f.T_map_vehicle);
  out.u8(f.planar ? 1 : 0);
  out.varint(f.file_offset);
  write_points(out, f.points);
  return out.take();
}

Result<RawlogFrame> read_frame(ByteSpan payload) {
  ByteReader in(payload);
  RawlogFrame f;
  f.number = in.varint();
  f.group = in.varint();
  MAPCODEC_ASSIGN(f.class_name, read_text(in));
  MAPCODEC_ASSIGN(f.sensor, read_text(in));
  const bool has_stamp = in.u8() != 0;
  const double stamp = in.f64();
  if (has_stamp && std::isfinite(stamp)) f.stamp_s = stamp;
  f.T_vehicle_sensor = read_pose(in);
  f.T_odom_vehicle = read_optional_pose(in);
  f.T_map_vehicle = read_optional_pose(in);
  f.planar = in.u8() != 0;
  f.file_offset = in.varint();
  MAPCODEC_TRY(in.status("the reader's answer"));
  MAPCODEC_TRY(check(f.T_vehicle_sensor));
  MAPCODEC_TRY(check(f.T_odom_vehicle));
  MAPCODEC_TRY(check(f.T_map_vehicle));
  MAPCODEC_ASSIGN(f.points, read_points(in));
  return f;
}

Bytes write_summary(const RawlogSummary& s) {
  ByteWriter out;
  out.varint(s.observations);
  out.varint(s.classes.size());
  for (const RawlogClass& c : s.classes) {
    out.text(c.name);
    out.varint(c.count);
    out.text(c.remark);
  }
  return out.take();
}

Result<RawlogSummary> read_summary(ByteSpan payload) {
  ByteReader in(payload);
  RawlogSummary s;
  s.observations = in.varint();
  const std::uint64_t classes = in.varint();
  if (classes > kMostClasses) return malformed("too many classes");
  for (std::uint64_t i = 0; i < classes && in.ok(); ++i) {
    RawlogClass c;
    MAPCODEC_ASSIGN(c.name, read_text(in));
    c.count = in.varint();
    MAPCODEC_ASSIGN(c.remark, read_text(in));
    s.classes.push_back(std::move(c));
  }
  MAPCODEC_TRY(in.status("the reader's answer"));
  return s;
}

Bytes write_error(const Error& e) {
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(e.code));
  out.u8(e.offset ? 1 : 0);
  out.u64(e.offset.value_or(0));
  out.text(e.message.substr(0, kLongestText));
  return out.take();
}

Error read_error(ByteSpan payload) {
  ByteReader in(payload);
  const std::uint8_t code = in.u8();
  const bool has_offset = in.u8() != 0;
  const std::uint64_t offset = in.u64();
  const auto text = read_text(in);
  if (!in.ok() || !text.ok() || code > static_cast<std::uint8_t>(ErrorCode::kUnreachable))
    return malformed("an error that is none");
  return make_error(static_cast<ErrorCode>(code), *text, has_offset ? std::optional(offset) : std::nullopt);
}

}  // namespace mapcodec
