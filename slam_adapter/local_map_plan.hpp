// SPDX-License-Identifier: GPL-3.0-or-later
// Which tiles a robot needs, now and soon.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// Where the robot is and where it goes, from its last poses.
class Motion {
 public:
  /// @param p        [m, map frame]
  /// @param stamp_s  any clock that does not go back; poses of equal or earlier stamps say nothing of speed.
  void move_to(const Vec3& p, double stamp_s);
  [[nodiscard]] const Vec3& position() const { return position_; }
  /// [m/s], smoothed over some poses; 0 after the first pose and after a jump.
  [[nodiscard]] const Vec3& velocity() const { return velocity_; }

 private:
  std::optional<double> stamp_s_;
  Vec3 position_{0, 0, 0}, velocity_{0, 0, 0};
};

struct WantedTile {
  std::size_t tile = 0;
  double order = 0;  ///< the less, the sooner: distance [m]; of tiles ahead the radius and the way until then
  bool near = false;  ///< within the radius now
};

struct WantSettings {
  double radius_m = 50;
  double ahead_s = 3;  ///< how far into the future tiles are fetched
};

/// Distance of a box from a point [m]; infinite if the box is empty.
[[nodiscard]] double distance(const Box& box, const Vec3& p);

/// Tiles within the radius, then those that come within it on the way, the soonest first. O(tiles of the
/// map).
/// @param boxes  of the map's tiles [m, map frame].
[[nodiscard]] std::vector<WantedTile> wanted_tiles(const std::vector<Box>& boxes, const Vec3& position,
                                                   const Vec3& velocity, const WantSettings& settings);

}  // namespace mapcodec
