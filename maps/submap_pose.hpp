// SPDX-License-Identifier: GPL-3.0-or-later
// Submaps have poses: from the frame of a submap to the map's, and back.
#pragma once

#include <optional>

#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"

namespace mapcodec {

/// A new pose for one submap: T_map_submap.
struct PoseChange {
  std::uint32_t submap = 0;  ///< index into MapInfo::submaps
  Vec3 translation_m{0, 0, 0};
  std::array<double, 4> rotation_xyzw{0, 0, 0, 1};  ///< of length 1 within 1e-6
};

/// Errors: InvalidArgument (NaN, infinite, or a quaternion that is not of length 1 within 1e-6).
[[nodiscard]] Status check_pose(const Vec3& translation_m, const std::array<double, 4>& rotation_xyzw);

/// A rigid motion, ready to be applied to many points. Threads: const methods from many at once.
class RigidMotion {
 public:
  RigidMotion() = default;
  /// @param rotation_xyzw  normalised here.
  RigidMotion(const Vec3& translation_m, const std::array<double, 4>& rotation_xyzw);

  [[nodiscard]] bool is_identity() const { return identity_; }
  [[nodiscard]] Vec3 apply(const Vec3& p) const;          ///< exactly `p` for the identity
  [[nodiscard]] Vec3 apply_inverse(const Vec3& p) const;  ///< exactly `p` for the identity
  [[nodiscard]] Vec3 rotate(const Vec3& direction) const;
  /// A box that contains the moved one, widened for rounding; empty stays empty, infinite sides stay far.
  [[nodiscard]] Box apply(const Box& box) const;
  [[nodiscard]] Box apply_inverse(const Box& box) const;

 private:
  std::array<std::array<double, 3>, 3> rotation_{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  Vec3 translation_{0, 0, 0};
  bool identity_ = true;
};

/// T_map_submap; identity for a submap that the table does not have.
[[nodiscard]] RigidMotion pose_of(const MapInfo& info, std::uint32_t submap);

/// Asks tile after tile whether it meets a box of the map's frame, as the poses stand. Conservative: says yes
/// to every tile whose bounds meet it. Quick where tiles of one submap follow one another.
class PosedQuery {
 public:
  /// @param info  must outlive the query.
  /// @param box   [m, map frame]
  PosedQuery(const MapInfo& info, const Box& box) : info_(info), box_(box) {}
  [[nodiscard]] bool meets(const TileRecord& tile);

 private:
  const MapInfo& info_;
  Box box_, box_in_submap_;
  RigidMotion pose_;
  std::optional<std::uint32_t> submap_;
};

}  // namespace mapcodec
