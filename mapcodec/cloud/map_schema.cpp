// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/cloud/map_schema.hpp"

#include <cmath>

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;

Error malformed(const std::string& what, const ByteReader& in) {
  return make_error(ErrorCode::kMalformed, "map schema: " + what, in.offset());
}

void write_vec(ByteWriter& out, const Vec3& v) {
  for (const double x : v) out.f64(x);
}
Vec3 read_vec(ByteReader& in) {
  Vec3 v;
  for (double& x : v) x = in.f64();
  return v;
}

void write_channel(ByteWriter& out, const ChannelSchema& c) {
  out.text(c.info.name);
  out.u8(static_cast<std::uint8_t>(c.info.scalar));
  out.u8(c.info.components);
  out.u8(static_cast<std::uint8_t>(c.kept));
  if (c.kept == ChannelKept::bounded) out.f64(c.bound);
  if (c.kept == ChannelKept::constant) out.raw(c.constant);
}

Result<ChannelSchema> read_channel(ByteReader& in) {
  ChannelSchema c;
  c.info.name = in.text();
  c.info.scalar = static_cast<ScalarType>(in.u8());
  c.info.components = in.u8();
  c.kept = static_cast<ChannelKept>(in.u8());
  MAPCODEC_TRY(in.status("map schema"));
  if (c.info.name.empty() || c.info.stride() == 0)
    return malformed("channel without name, type or components", in);
  if (c.kept < ChannelKept::exact || c.kept > ChannelKept::dropped)
    return malformed("unknown way to keep a channel", in);
  if (c.kept == ChannelKept::bounded) {
    c.bound = in.f64();
    if (!(c.bound > 0) || !std::isfinite(c.bound)) return malformed("channel bound is not positive", in);
  }
  if (c.kept == ChannelKept::constant) {
    const ByteSpan v = in.raw(c.info.stride());
    c.constant.assign(v.begin(), v.end());
  }
  return c;
}

Status check_numbers(const MapSchema& s, const ByteReader& in) {
  if (!is_finite(s.origin) || !is_finite(s.coordinates.scale) || !is_finite(s.coordinates.offset)) {
    return malformed("a coordinate is not finite", in);
  }
  if (!(s.tile_size_m > 0) || !std::isfinite(s.tile_size_m))
    return malformed("tile size is not positive", in);
  if (!(s.step_m >= 0) || !std::isfinite(s.step_m)) return malformed("step is negative", in);
  if (!(s.promise_value >= 0) || !std::isfinite(s.promise_value)) return malformed("promise is negative", in);
  if (s.promise < PromiseKind::rms || s.promise > PromiseKind::paper) return malformed("unknown promise", in);
  const Kind k = s.coordinates.kind;
  if (k < Kind::f32 || k > Kind::fixed) return malformed("unknown coordinate format", in);
  if (k == Kind::fixed) {
    for (const double v : s.coordinates.scale) {
      if (!(v > 0)) return malformed("coordinate scale is not positive", in);
    }
  }
  return {};
}

}  // namespace

PointCloud MapSchema::layout() const {
  PointCloud r;
  r.coordinates = coordinates;
  for (const ChannelSchema& c : channels) {
    if (c.kept != ChannelKept::dropped) r.channels.push_back({c.info, {}});
  }
  return r;
}

Bytes write_schema(const MapSchema& s) {
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(s.promise));
  out.u8(static_cast<std::uint8_t>(s.coordinates.kind));
  out.f64(s.promise_value);
  write_vec(out, s.origin);
  out.f64(s.tile_size_m);
  out.f64(s.step_m);
  if (s.coordinates.kind == Kind::fixed) {
    write_vec(out, s.coordinates.scale);
    write_vec(out, s.coordinates.offset);
  }
  out.varint(s.channels.size());
  for (const ChannelSchema& c : s.channels) write_channel(out, c);
  if (s.occupancy) out.u8(static_cast<std::uint8_t>(*s.occupancy));
  return out.take();
}

Result<MapSchema> read_schema(ByteSpan bytes, const DecodeLimits& limits) {
  ByteReader in(bytes);
  MapSchema s;
  s.promise = static_cast<PromiseKind>(in.u8());
  s.coordinates.kind = static_cast<Kind>(in.u8());
  s.promise_value = in.f64();
  s.origin = read_vec(in);
  s.tile_size_m = in.f64();
  s.step_m = in.f64();
  if (s.coordinates.kind == Kind::fixed) {
    s.coordinates.scale = read_vec(in);
    s.coordinates.offset = read_vec(in);
  }
  const std::uint64_t count = in.varint();
  MAPCODEC_TRY(in.status("map schema"));
  MAPCODEC_TRY(check_numbers(s, in));
  if (count > limits.max_channels)
    return make_error(ErrorCode::kLimitExceeded, "map schema: too many channels", in.offset());
  for (std::uint64_t i = 0; i < count; ++i) {
    MAPCODEC_ASSIGN(ChannelSchema c, read_channel(in));
    s.channels.push_back(std::move(c));
  }
  if (in.left() > 0) s.occupancy = static_cast<OccupancyKind>(in.u8());
  MAPCODEC_TRY(in.status("map schema"));
  if (s.occupancy && (*s.occupancy < OccupancyKind::binary || *s.occupancy > OccupancyKind::color))
    return malformed("unknown kind of occupancy", in);
  return s;
}

}  // namespace mapcodec
