// SPDX-License-Identifier: GPL-3.0-or-later
// Colour errors between points and their nearest neighbours.
#pragma once

#include <optional>

#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/quality/nearest.hpp"

namespace mapcodec {

/// The colour channel of a cloud on the scale 0..255, where it has one: "rgb" of three u8, or of three u16
/// (over 257).
class Colors {
 public:
  /// nullopt if there is no such channel. The cloud must outlive it.
  [[nodiscard]] static std::optional<Colors> of(const PointCloud& cloud);
  [[nodiscard]] Vec3 at(std::size_t i) const;

 private:
  explicit Colors(const Channel& channel) : channel_(&channel) {}
  const Channel* channel_;
};

/// One direction: means over all points of `from`.
struct ColorStats {
  double mean_distance = 0;  ///< Euclidean, RGB 0..255
  double luma_mse = 0;       ///< of BT.709 luma, 0..255
};
[[nodiscard]] ColorStats color_difference(const Colors& from, const Colors& to, const Nearest& nearest);

}  // namespace mapcodec
