// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/submap_pose.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

constexpr double kUnitTolerance = 1e-6;
constexpr double kFar = 1e100;  // stands for infinity: its products stay finite

double squared_length(const std::array<double, 4>& q) {
  return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
}

/// The moved box as centre and half sides: 3 multiplications a side instead of 8 corners.
template <class Map>
Box move_box(const Box& box, const std::array<std::array<double, 3>, 3>& r, bool transposed,
             const Vec3& translation, Map map) {
  if (box.empty()) return box;
  Vec3 centre, half;
  for (std::size_t d = 0; d < 3; ++d) {
    const double low = std::clamp(box.min[d], -kFar, kFar), high = std::clamp(box.max[d], -kFar, kFar);
    centre[d] = (low + high) / 2;
    half[d] = (high - low) / 2;
  }
  const Vec3 moved = map(centre);
  Box out;
  for (std::size_t i = 0; i < 3; ++i) {
    double reach = 0, size = std::abs(moved[i]);
    for (std::size_t j = 0; j < 3; ++j) {
      reach += std::abs(transposed ? r[j][i] : r[i][j]) * half[j];
      size += std::abs(centre[j]) + half[j] + std::abs(translation[j]);
    }
    reach += 0x1p-48 * size;  // more than rounding can lose
    out.min[i] = moved[i] - reach;
    out.max[i] = moved[i] + reach;
  }
  return out;
}

}  // namespace

Status check_pose(const Vec3& translation_m, const std::array<double, 4>& rotation_xyzw) {
  const bool finite = is_finite(translation_m) && std::all_of(rotation_xyzw.begin(), rotation_xyzw.end(),
                                                              [](double v) { return std::isfinite(v); });
  if (!finite) return make_error(ErrorCode::kInvalidArgument, "a pose is not finite");
  if (!(std::abs(std::sqrt(squared_length(rotation_xyzw)) - 1) <= kUnitTolerance))
    return make_error(ErrorCode::kInvalidArgument, "the quaternion of a pose is not of length 1");
  return {};
}

RigidMotion::RigidMotion(const Vec3& translation_m, const std::array<double, 4>& rotation_xyzw)
    : translation_(translation_m) {
  const double n = squared_length(rotation_xyzw), s = n > 0 ? 2 / n : 0;
  const auto [x, y, z, w] = rotation_xyzw;
  rotation_ = {{{1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)},
                {s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)},
                {s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)}}};
  identity_ = x == 0 && y == 0 && z == 0 && translation_m == Vec3{0, 0, 0};
}

Vec3 RigidMotion::rotate(const Vec3& p) const {
  if (identity_) return p;
  Vec3 out;
  for (std::size_t i = 0; i < 3; ++i)
    out[i] = rotation_[i][0] * p[0] + rotation_[i][1] * p[1] + rotation_[i][2] * p[2];
  return out;
}

Vec3 RigidMotion::apply(const Vec3& p) const {
  if (identity_) return p;
  const Vec3 r = rotate(p);
  return {r[0] + translation_[0], r[1] + translation_[1], r[2] + translation_[2]};
}

Vec3 RigidMotion::apply_inverse(const Vec3& p) const {
  if (identity_) return p;
  const Vec3 d{p[0] - translation_[0], p[1] - translation_[1], p[2] - translation_[2]};
  Vec3 out;
  for (std::size_t i = 0; i < 3; ++i)
    out[i] = rotation_[0][i] * d[0] + rotation_[1][i] * d[1] + rotation_[2][i] * d[2];
  return out;
}

Box RigidMotion::apply(const Box& box) const {
  if (identity_) return box;
  return move_box(box, rotation_, false, translation_, [this](const Vec3& p) { return apply(p); });
}

Box RigidMotion::apply_inverse(const Box& box) const {
  if (identity_) return box;
  return move_box(box, rotation_, true, translation_, [this](const Vec3& p) { return apply_inverse(p); });
}

RigidMotion pose_of(const MapInfo& info, std::uint32_t submap) {
  if (submap >= info.submaps.size()) return {};
  return {info.submaps[submap].translation_m, info.submaps[submap].rotation_xyzw};
}

/// Two tests, each conservative: the query in the submap's frame, and the tile's box in the map's.
bool PosedQuery::meets(const TileRecord& tile) {
  if (submap_ != tile.submap) {
    submap_ = tile.submap;
    pose_ = pose_of(info_, tile.submap);
    box_in_submap_ = pose_.apply_inverse(box_);
  }
  if (!tile.bounds.intersects(box_in_submap_)) return false;
  return pose_.is_identity() || pose_.apply(tile.bounds).intersects(box_);
}

}  // namespace mapcodec
