// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/map_progress.hpp"

#include "mapcodec/base/byte_reader.hpp"

namespace mapcodec {
namespace {

constexpr std::uint8_t kVersion = 1;

void put(ByteWriter& out, const MapPose& p) {
  for (const double v : p.translation_m) out.f64(v);
  for (const double v : p.rotation_xyzw) out.f64(v);
}
MapPose take(ByteReader& in) {
  MapPose p;
  for (double& v : p.translation_m) v = in.f64();
  for (double& v : p.rotation_xyzw) v = in.f64();
  return p;
}

void put(ByteWriter& out, const TrackState& t) {
  put(out, t.T_map_vehicle);
  put(out, t.step);
  out.u8(t.stamp_s ? 1 : 0);
  out.f64(t.stamp_s.value_or(0));
  out.f64(t.step_s);
  out.u8(t.T_odom_vehicle ? 1 : 0);
  put(out, t.T_odom_vehicle.value_or(MapPose{}));
  out.f64(t.radius_m);
}
TrackState take_track(ByteReader& in) {
  TrackState t;
  t.T_map_vehicle = take(in);
  t.step = take(in);
  const bool has_stamp = in.u8() != 0;
  const double stamp = in.f64();
  if (has_stamp) t.stamp_s = stamp;
  t.step_s = in.f64();
  const bool has_odometry = in.u8() != 0;
  const MapPose odometry = take(in);
  if (has_odometry) t.T_odom_vehicle = odometry;
  t.radius_m = in.f64();
  return t;
}

}  // namespace

Bytes write_progress(const MapProgress& p) {
  ByteWriter out;
  out.u8(kVersion);
  for (const std::uint64_t v :
       {p.fingerprint, p.next, p.keyframes, p.place, p.frames, p.without_pose, p.thinned_out, p.lost})
    out.varint(v);
  put(out, p.last_keyframe);
  out.u8(p.track ? 1 : 0);
  if (p.track) put(out, *p.track);
  out.u8(p.complete ? 1 : 0);
  return out.take();
}

Result<MapProgress> read_progress(ByteSpan bytes) {
  ByteReader in(bytes);
  if (in.u8() != kVersion)
    return make_error(ErrorCode::kUnsupported, "was begun by another version of this program");
  MapProgress p;
  for (std::uint64_t* v :
       {&p.fingerprint, &p.next, &p.keyframes, &p.place, &p.frames, &p.without_pose, &p.thinned_out, &p.lost})
    *v = in.varint();
  p.last_keyframe = take(in);
  if (in.u8() != 0) p.track = take_track(in);
  p.complete = in.u8() != 0;
  MAPCODEC_TRY(in.status("the state of an interrupted run"));
  return p;
}

}  // namespace mapcodec
