// SPDX-License-Identifier: GPL-3.0-or-later
// Pictures of clouds: what a number of millimetres looks like.
#pragma once

#include <string>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

struct RenderSettings {
  int width = 1600, height = 760;  ///< of the whole picture [pixels]
  double azimuth_deg =
      35;  ///< where the eye stands around the cloud, from the -y side (or the sensor's side)
  double elevation_deg = 32;  ///< how far above
  bool camera_frame_views =
      true;  ///< look at a cloud in a camera's frame (z forward) from where the camera stood
  std::string left_caption, right_caption;
};

/// Draws both clouds side by side with the same eye, fitted to `left`'s extent (its outermost 1 % may fall
/// outside), as round splats large enough to close the surface, in their colours or else by height, shaded by
/// depth; to a PNG. An empty `right` leaves the picture to `left` alone. Errors: Empty (left has no finite
/// point); InvalidArgument (size); CannotWrite. Threads: pure but for the file.
[[nodiscard]] Status render_side_by_side(const PointCloud& left, const PointCloud& right,
                                         const RenderSettings& settings, const std::string& path);

}  // namespace mapcodec
