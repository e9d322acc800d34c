// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render_camera.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

Vec3 minus(const Vec3& a, const Vec3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vec3 unit(const Vec3& a) {
  const double l = std::sqrt(dot(a, a));
  return {a[0] / l, a[1] / l, a[2] / l};
}

/// Where the eye stands and which way is up.
struct View {
  Vec3 direction;  ///< from the eye to the cloud, unit
  Vec3 up;
};

/// A cloud that lies in a cone before the origin along z is one frame of a depth camera: +1 with z forward
/// and y down, -1 with z backward and y up, 0 otherwise.
int camera_side(const std::vector<Vec3>& points) {
  std::size_t forward = 0, backward = 0;
  for (const Vec3& p : points) {
    const double z = std::abs(p[2]);
    if (z < 0.2 || z > 15 || std::abs(p[0]) > 0.8 * z || std::abs(p[1]) > 0.7 * z) continue;
    ++(p[2] > 0 ? forward : backward);
  }
  if (forward * 20 > points.size() * 19) return 1;
  return backward * 20 > points.size() * 19 ? -1 : 0;
}

Vec3 oblique(const Vec3& forward, const Vec3& right, const Vec3& up, double azimuth_deg,
             double elevation_deg) {
  const double radian = std::acos(-1.0) / 180;
  const double a = azimuth_deg * radian, e = elevation_deg * radian;
  Vec3 d{};
  for (std::size_t i = 0; i < 3; ++i) {
    d[i] = std::cos(e) * (std::cos(a) * forward[i] - std::sin(a) * right[i]) - std::sin(e) * up[i];
  }
  return d;
}

View choose_view(const std::vector<Vec3>& points, const RenderSettings& s) {
  const int side = s.camera_frame_views ? camera_side(points) : 0;
  if (side == 0) return {oblique({0, 1, 0}, {1, 0, 0}, {0, 0, 1}, s.azimuth_deg, s.elevation_deg), {0, 0, 1}};
  const double sign = side;
  const Vec3 up{0, -sign, 0};
  // Only a little aside: behind the objects a depth camera saw nothing.
  return {oblique({0, 0, sign}, {1, 0, 0}, up, s.azimuth_deg / 3, s.elevation_deg / 3), up};
}

}  // namespace

std::vector<Vec3> sample(const PointCloud& cloud) {
  std::vector<Vec3> r;
  const std::size_t step = std::max<std::size_t>(1, cloud.size() / 100000);
  for (std::size_t i = 0; i < cloud.size(); i += step) {
    if (is_finite(cloud.xyz[i])) r.push_back(cloud.xyz[i]);
  }
  return r;
}

double quantile(std::vector<double>& values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

Box inner_box(const std::vector<Vec3>& points) {
  Box b;
  for (std::size_t d = 0; d < 3; ++d) {
    std::vector<double> v;
    for (const Vec3& p : points) v.push_back(p[d]);
    b.min[d] = quantile(v, 0.01);
    b.max[d] = quantile(v, 0.99);
  }
  return b;
}

double diagonal(const Box& box) {
  const Vec3 size = minus(box.max, box.min);
  return std::sqrt(dot(size, size));
}

Camera::Camera(const Vec3& eye, const Vec3& target, const Vec3& up, double focal_px)
    : eye_(eye), forward_(unit(minus(target, eye))), focal_(focal_px) {
  right_ = unit(cross(forward_, up));
  down_ = cross(forward_, right_);
}

Camera::Pixel Camera::project(const Vec3& p) const {
  const Vec3 v = minus(p, eye_);
  const double z = dot(v, forward_);
  return {cx_ + focal_ * dot(v, right_) / z, cy_ + focal_ * dot(v, down_) / z, z};
}

void Camera::zoom_to(const Box& pixels, double width, double height) {
  constexpr double kMargin = 0.95;
  const double w = std::max(pixels.max[0] - pixels.min[0], 1e-9),
               h = std::max(pixels.max[1] - pixels.min[1], 1e-9);
  const double scale = kMargin * std::min(width / w, height / h);
  focal_ *= scale;
  cx_ = width / 2 - scale * ((pixels.min[0] + pixels.max[0]) / 2 - cx_);
  cy_ = height / 2 - scale * ((pixels.min[1] + pixels.max[1]) / 2 - cy_);
}

Camera fit_camera(const std::vector<Vec3>& points, const RenderSettings& s, int width, int height) {
  const Box box = inner_box(points);
  const View view = choose_view(points, s);
  const double far = 1.6 * std::max(diagonal(box), 1e-6);
  Vec3 centre{}, eye{};
  for (std::size_t d = 0; d < 3; ++d) {
    centre[d] = (box.min[d] + box.max[d]) / 2;
    eye[d] = centre[d] - far * view.direction[d];
  }
  Camera camera(eye, centre, view.up, height);
  Box pixels;
  for (const Vec3& p : points) {
    if (!box.contains(p)) continue;
    const Camera::Pixel q = camera.project(p);
    pixels.add(Vec3{q.x, q.y, 0});
  }
  if (!pixels.empty()) camera.zoom_to(pixels, width, height);
  return camera;
}

}  // namespace mapcodec
