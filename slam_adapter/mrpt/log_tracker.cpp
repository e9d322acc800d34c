// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/log_tracker.hpp"

#include <algorithm>
#include <cmath>

#include "slam_adapter/mrpt/pose_math.hpp"

namespace mapcodec {
namespace {

constexpr double kPatience = 120;   // [s] for tiles to be loaded
constexpr double kLongestStep = 2;  // a motion is not drawn out over more than this many of its own times

/// The distance within which nine of ten points lie.
double reach_of(const PointCloud& scan) {
  std::vector<double> ranges;
  for (const Vec3& p : scan.xyz) {
    if (is_finite(p)) ranges.push_back(length_of(p));
  }
  if (ranges.empty()) return 1;
  const auto most = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() * 9 / 10);
  std::nth_element(ranges.begin(), most, ranges.end());
  return std::max(1.0, *most);
}

}  // namespace

LogTracker::LogTracker(std::string map_path, Registrar registrar, std::uint64_t memory_bytes, Arena& arena)
    : path_(std::move(map_path)),
      registrar_(std::move(registrar)),
      memory_bytes_(memory_bytes),
      arena_(arena) {}
LogTracker::~LogTracker() = default;

MapPose LogTracker::guess(const RawlogFrame& f) const {
  const TrackState& t = *state_;
  if (t.T_odom_vehicle && f.T_odom_vehicle)
    return compose(t.T_map_vehicle, between(*t.T_odom_vehicle, *f.T_odom_vehicle));
  // As it moved before, for as long as now; after a jump in time nothing is known.
  if (!t.stamp_s || !f.stamp_s || !(t.step_s > 0)) return t.T_map_vehicle;
  const double share = (*f.stamp_s - *t.stamp_s) / t.step_s;
  if (!(share > 0 && share <= kLongestStep)) return t.T_map_vehicle;
  return compose(t.T_map_vehicle, interpolated(MapPose{}, t.step, share));
}

Result<std::shared_ptr<const LocalMapView>> LogTracker::around(const MapPose& pose) {
  if (!map_) {
    LocalMapSettings settings;
    settings.radius_m = state_->radius_m;
    settings.keep_radius_m = state_->radius_m;  // what a view holds must not depend on the way to it
    settings.memory_bytes = memory_bytes_;
    settings.ahead_s = 0;
    settings.content.index = false;
    MAPCODEC_ASSIGN(map_, LocalMap::open(path_, settings, arena_));
  }
  MAPCODEC_TRY(map_->refresh());
  MAPCODEC_TRY(map_->move_to(pose, 0.0));
  const auto ready = map_->wait_ready(kPatience);
  // A budget that does not hold everything leaves the nearest tiles, which will do.
  if (!ready.ok() && ready.error().code != ErrorCode::kLimitExceeded) return ready.error();
  return map_->view();
}

void LogTracker::remember(const RawlogFrame& f, const MapPose& pose) {
  TrackState next;
  next.T_map_vehicle = pose;
  if (state_) {
    next.step = between(state_->T_map_vehicle, pose);
    next.radius_m = state_->radius_m;
    if (state_->stamp_s && f.stamp_s) next.step_s = *f.stamp_s - *state_->stamp_s;
  }
  next.stamp_s = f.stamp_s;
  next.T_odom_vehicle = f.T_odom_vehicle;
  state_ = next;
}

Result<std::optional<MapPose>> LogTracker::track(const RawlogFrame& frame, const PointCloud& scan) {
  if (!state_) {
    remember(frame, MapPose{});
    state_->radius_m = reach_of(scan);
    return std::optional(MapPose{});
  }
  const MapPose begin = guess(frame);
  MAPCODEC_ASSIGN(const auto view, around(begin));
  const auto pose = registrar_(scan, *view, begin);
  if (!pose.ok()) return std::optional<MapPose>{};
  remember(frame, *pose);
  return std::optional(*pose);
}

}  // namespace mapcodec
