// SPDX-License-Identifier: GPL-3.0-or-later
// Where the eye of a picture stands.
#pragma once

#include <vector>

#include "mapcodec/cloud/point_cloud.hpp"
#include "tools/render.hpp"

namespace mapcodec {

/// Every n-th finite point, about 100,000 of them: enough for extents.
[[nodiscard]] std::vector<Vec3> sample(const PointCloud& cloud);
/// The value below which `share` of them lie; reorders them. Not empty.
[[nodiscard]] double quantile(std::vector<double>& values, double share);
/// Extent without the outermost hundredth at each end of each axis. Not empty.
[[nodiscard]] Box inner_box(const std::vector<Vec3>& points);
[[nodiscard]] double diagonal(const Box& box);

/// A pinhole eye. In its frame x is right, y down, z forward.
class Camera {
 public:
  Camera(const Vec3& eye, const Vec3& target, const Vec3& up, double focal_px);

  struct Pixel {
    double x, y, depth;
  };
  [[nodiscard]] Pixel project(const Vec3& p) const;
  [[nodiscard]] double focal() const { return focal_; }
  /// Scales and moves the picture so that what now fills `pixels` fills the panel but for a margin.
  void zoom_to(const Box& pixels, double width, double height);

 private:
  Vec3 eye_, forward_, right_{}, down_{};
  double focal_, cx_ = 0, cy_ = 0;
};

/// An eye from which `points` fill a panel of width x height pixels, standing as the settings say.
[[nodiscard]] Camera fit_camera(const std::vector<Vec3>& points, const RenderSettings& settings, int width,
                                int height);

}  // namespace mapcodec
