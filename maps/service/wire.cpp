// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/wire.hpp"

#include <bit>
#include <cmath>
#include <cstring>

namespace mapcodec::wire {
namespace {

static_assert(std::endian::native == std::endian::little, "packed numbers are copied as they lie");

constexpr std::size_t kMostChannels = 64;
constexpr std::size_t kLongestName = 255;

Error malformed(const std::string& what) {
  return make_error(ErrorCode::kMalformed, what);
}

template <class T>
void copy_xyz(const std::string& bytes, std::vector<Vec3>& xyz) {
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    T p[3];
    std::memcpy(p, bytes.data() + i * sizeof p, sizeof p);
    xyz[i] = {double(p[0]), double(p[1]), double(p[2])};
  }
}

Status read_xyz(const v1::Points& points, PointCloud& cloud) {
  const bool f32 = !points.xyz_f32().empty(), f64 = !points.xyz_f64().empty();
  if (f32 && f64) return malformed("points have float32 or float64 coordinates, not both");
  const std::string& bytes = f64 ? points.xyz_f64() : points.xyz_f32();
  const std::size_t stride = f64 ? 24 : 12;
  if (bytes.size() % stride != 0 || bytes.size() / stride != points.count())
    return malformed(std::to_string(points.count()) + " points do not have " + std::to_string(bytes.size()) +
                     " bytes of coordinates");
  cloud.xyz.resize(points.count());
  if (f64) {
    copy_xyz<double>(bytes, cloud.xyz);
  } else {
    copy_xyz<float>(bytes, cloud.xyz);
  }
  cloud.coordinates.kind = f64 ? CoordinateFormat::Kind::f64 : CoordinateFormat::Kind::f32;
  return {};
}

template <class T>
void put_xyz(const PointCloud& cloud, std::size_t begin, std::size_t end, std::string& out) {
  out.resize((end - begin) * 3 * sizeof(T));
  for (std::size_t i = begin; i < end; ++i) {
    const Vec3& p = cloud.xyz[i];
    const T v[3] = {static_cast<T>(p[0]), static_cast<T>(p[1]), static_cast<T>(p[2])};
    std::memcpy(out.data() + (i - begin) * sizeof v, v, sizeof v);
  }
}

}  // namespace

Result<ChannelInfo> read(const v1::Channel& channel) {
  ChannelInfo info;
  info.name = channel.name();
  if (info.name.empty() || info.name.size() > kLongestName)
    return malformed("the name of a channel has 1 to 255 bytes");
  info.scalar = static_cast<ScalarType>(channel.scalar());
  const bool known = channel.scalar() >= 1 && channel.scalar() <= 10;
  if (!known || channel.components() < 1 || channel.components() > 255)
    return malformed("channel '" + info.name + "' is of no known type");
  info.components = static_cast<std::uint8_t>(channel.components());
  return info;
}

void write(const ChannelInfo& info, v1::Channel& out) {
  out.set_name(info.name);
  out.set_scalar(static_cast<v1::Scalar>(info.scalar));
  out.set_components(info.components);
}

Result<PointCloud> read(const v1::Points& points, std::uint64_t max_points) {
  if (points.count() > max_points)
    return make_error(ErrorCode::kLimitExceeded, "at most " + std::to_string(max_points) + " points at once");
  if (std::size_t(points.channels_size()) > kMostChannels)
    return make_error(ErrorCode::kLimitExceeded, "at most " + std::to_string(kMostChannels) + " channels");
  PointCloud cloud;
  MAPCODEC_TRY(read_xyz(points, cloud));
  for (const v1::Channel& c : points.channels()) {
    Channel channel;
    MAPCODEC_ASSIGN(channel.info, read(c));
    if (cloud.find(channel.info.name) != nullptr)
      return malformed("channel '" + channel.info.name + "' is there twice");
    if (c.data().size() != channel.info.stride() * cloud.size())
      return malformed("channel '" + channel.info.name + "' has " + std::to_string(c.data().size()) +
                       " bytes for " + std::to_string(cloud.size()) + " points");
    channel.data.assign(c.data().begin(), c.data().end());
    cloud.channels.push_back(std::move(channel));
  }
  return cloud;
}

void write(const PointCloud& cloud, std::size_t begin, std::size_t end, bool f64, v1::Points& out) {
  out.set_count(end - begin);
  if (f64) {
    put_xyz<double>(cloud, begin, end, *out.mutable_xyz_f64());
  } else {
    put_xyz<float>(cloud, begin, end, *out.mutable_xyz_f32());
  }
  for (const Channel& c : cloud.channels) {
    v1::Channel& channel = *out.add_channels();
    write(c.info, channel);
    const auto* data = reinterpret_cast<const char*>(c.data.data());
    channel.set_data(data + begin * c.info.stride(), (end - begin) * c.info.stride());
  }
}

Result<PoseChange> read(const v1::Pose& pose) {
  PoseChange p;
  p.translation_m = read(pose.translation());
  std::array<double, 4> q{pose.qx(), pose.qy(), pose.qz(), pose.qw()};
  if (q == std::array<double, 4>{0, 0, 0, 0}) q[3] = 1;
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(std::abs(length - 1) < 1e-3))
    return make_error(ErrorCode::kInvalidArgument, "the quaternion of a pose has length 1");
  // What has length 1 already stays as it is, bit for bit.
  const double scale = std::abs(length - 1) < 1e-12 ? 1 : 1 / length;
  for (std::size_t i = 0; i < 4; ++i) p.rotation_xyzw[i] = q[i] * scale;
  MAPCODEC_TRY(check_pose(p.translation_m, p.rotation_xyzw));
  return p;
}

void write(const Vec3& translation_m, const std::array<double, 4>& q, v1::Pose& out) {
  write(translation_m, *out.mutable_translation());
  out.set_qx(q[0]);
  out.set_qy(q[1]);
  out.set_qz(q[2]);
  out.set_qw(q[3]);
}

Vec3 read(const v1::Vector& v) {
  return {v.x(), v.y(), v.z()};
}
void write(const Vec3& v, v1::Vector& out) {
  out.set_x(v[0]);
  out.set_y(v[1]);
  out.set_z(v[2]);
}

Box read(const v1::Box& box) {
  return {read(box.min()), read(box.max())};
}
void write(const Box& box, v1::Box& out) {
  write(box.min, *out.mutable_min());
  write(box.max, *out.mutable_max());
}

Result<TileSelection::Key> read(const v1::TileKey& key) {
  if (key.level() > kMaxTileLevel && key.level() != TileKey::kUnplacedLevel)
    return malformed("a tile has no level " + std::to_string(key.level()));
  return TileSelection::Key{key.submap(),
                            {key.x(), key.y(), key.z(), static_cast<std::uint8_t>(key.level())}};
}
void write(std::uint32_t submap, const TileKey& key, v1::TileKey& out) {
  out.set_x(key.x);
  out.set_y(key.y);
  out.set_z(key.z);
  out.set_level(key.level);
  out.set_submap(submap);
}

TileErrors read(const v1::TileErrors& e) {
  TileErrors errors;
  errors.rms_m = e.rms();
  errors.max_axis_error_m = e.max_axis();
  errors.color_error = e.color();
  errors.density_error = e.density();
  return errors;
}
void write(const TileErrors& e, v1::TileErrors& out) {
  out.set_rms(e.rms_m);
  out.set_max_axis(e.max_axis_error_m);
  out.set_color(e.color_error);
  out.set_density(e.density_error);
}

void write(const MapArchive& archive, v1::MapFacts& out) {
  const MapInfo& info = archive.info();
  out.set_revision(archive.revision());
  out.set_timestamp(archive.timestamp_s());
  out.set_schema(info.schema.data(), info.schema.size());
  write(info.origin, *out.mutable_origin());
  out.set_tile_size(info.tile_size_m);
  out.set_input_points(info.input_points);
  out.set_input_bytes(info.input_bytes);
  out.set_dropped_points(info.dropped_points);
  write(info.achieved, *out.mutable_achieved());
  if (!info.bounds.empty()) write(info.bounds, *out.mutable_bounds());
  out.set_flags(info.flags);
  for (const Submap& s : info.submaps) {
    v1::Submap& submap = *out.add_submaps();
    submap.set_name(s.name);
    write(s.translation_m, s.rotation_xyzw, *submap.mutable_t_map_submap());
    submap.set_first_stamp(s.first_stamp_s);
    submap.set_last_stamp(s.last_stamp_s);
  }
  for (const Snapshot& s : info.snapshots) {
    v1::NamedRevision& named = *out.add_snapshots();
    named.set_name(s.name);
    named.set_revision(s.revision);
  }
  for (const auto& [name, value] : info.extras)
    (*out.mutable_extras())[name].assign(value.begin(), value.end());
}

Result<MapInfo> read(const v1::MapFacts& facts) {
  MapInfo info;
  info.schema.assign(facts.schema().begin(), facts.schema().end());
  info.origin = read(facts.origin());
  info.tile_size_m = facts.tile_size();
  info.input_points = facts.input_points();
  info.input_bytes = facts.input_bytes();
  info.dropped_points = facts.dropped_points();
  info.achieved = read(facts.achieved());
  if (facts.has_bounds()) info.bounds = read(facts.bounds());
  info.flags = facts.flags();
  for (const v1::Submap& s : facts.submaps()) {
    MAPCODEC_ASSIGN(const PoseChange pose, read(s.t_map_submap()));
    info.submaps.push_back(
        {s.name(), pose.translation_m, pose.rotation_xyzw, s.first_stamp(), s.last_stamp()});
  }
  for (const v1::NamedRevision& s : facts.snapshots()) info.snapshots.push_back({s.name(), s.revision()});
  for (const auto& [name, value] : facts.extras()) info.extras[name].assign(value.begin(), value.end());
  return info;
}

void write(const TileChange& change, v1::TileChange& out) {
  out.set_kind(static_cast<v1::TileChange::Kind>(change.kind));
  write(change.submap, change.key, *out.mutable_key());
  if (change.kind != ChangeKind::removed) out.set_hash(bytes_of(change.hash));
  out.set_points(change.points_after);
  out.set_bytes(change.bytes_after);
  out.set_points_before(change.points_before);
  out.set_bytes_before(change.bytes_before);
}

std::string bytes_of(const ContentHash& hash) {
  return {hash.bytes.begin(), hash.bytes.end()};
}

Result<ContentHash> read_hash(std::string_view bytes) {
  ContentHash hash;
  if (bytes.size() != hash.bytes.size()) return malformed("a hash has 16 bytes");
  std::memcpy(hash.bytes.data(), bytes.data(), bytes.size());
  return hash;
}

}  // namespace mapcodec::wire
