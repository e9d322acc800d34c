// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/local_map_plan.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

/// Faster than this [m/s] nothing drives: the pose jumped (a relocalisation).
constexpr double kJumpSpeed = 150;
/// Weight of the newest pair of poses.
constexpr double kNewest = 0.5;
/// Looks ahead in steps of this share of the horizon.
constexpr int kSteps = 16;

double length(const Vec3& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

Vec3 ahead(const Vec3& p, const Vec3& v, double seconds) {
  return {p[0] + v[0] * seconds, p[1] + v[1] * seconds, p[2] + v[2] * seconds};
}

/// Seconds until the box comes within the radius; nothing if not within the horizon.
std::optional<double> reached_in(const Box& box, const Vec3& p, const Vec3& v, const WantSettings& s) {
  for (int i = 1; i <= kSteps; ++i) {
    const double seconds = s.ahead_s * i / kSteps;
    if (distance(box, ahead(p, v, seconds)) <= s.radius_m) return seconds;
  }
  return std::nullopt;
}

}  // namespace

void Motion::move_to(const Vec3& p, double stamp_s) {
  if (stamp_s_ && stamp_s > *stamp_s_) {
    const double dt = stamp_s - *stamp_s_;
    Vec3 v;
    for (std::size_t d = 0; d < 3; ++d) v[d] = (p[d] - position_[d]) / dt;
    const bool jump = !is_finite(v) || length(v) > kJumpSpeed;
    const bool standing = length(velocity_) == 0;
    for (std::size_t d = 0; d < 3; ++d)
      velocity_[d] = jump ? 0 : standing ? v[d] : velocity_[d] + kNewest * (v[d] - velocity_[d]);
  }
  if (!stamp_s_ || stamp_s > *stamp_s_) stamp_s_ = stamp_s;
  position_ = p;
}

double distance(const Box& box, const Vec3& p) {
  if (box.empty()) return INFINITY;
  double sum = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    const double out = std::max({box.min[d] - p[d], p[d] - box.max[d], 0.0});
    sum += out * out;
  }
  return std::sqrt(sum);
}

std::vector<WantedTile> wanted_tiles(const std::vector<Box>& boxes, const Vec3& position,
                                     const Vec3& velocity, const WantSettings& settings) {
  const double speed = length(velocity), reach = settings.radius_m + speed * settings.ahead_s;
  std::vector<WantedTile> wanted;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const double d = distance(boxes[i], position);
    if (d <= settings.radius_m) {
      wanted.push_back({i, d, true});
    } else if (speed > 0 && d <= reach) {
      const auto seconds = reached_in(boxes[i], position, velocity, settings);
      if (seconds) wanted.push_back({i, settings.radius_m + speed * *seconds, false});
    }
  }
  std::sort(wanted.begin(), wanted.end(), [](const WantedTile& a, const WantedTile& b) {
    return a.order != b.order ? a.order < b.order : a.tile < b.tile;
  });
  return wanted;
}

}  // namespace mapcodec
