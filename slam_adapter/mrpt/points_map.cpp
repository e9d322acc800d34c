// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/points_map.hpp"

#include <mrpt/maps/CPointsMapXYZI.h>
#include <mrpt/maps/CWeightedPointsMap.h>

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

constexpr double kFarthest = 16384;  // beyond it float32 loses millimetres

std::uint8_t byte_of(float share) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(share, 0.0F, 1.0F) * 255.0F));
}

Channel& add_channel(PointCloud& cloud, ChannelInfo info) {
  Channel c{std::move(info), {}};
  c.data.resize(c.info.stride() * cloud.size());
  return cloud.channels.emplace_back(std::move(c));
}

void add_colors(const mrpt::maps::CColouredPointsMap& map, PointCloud& cloud) {
  Channel& rgb = add_channel(cloud, {"rgb", ScalarType::u8, 3});
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    float x, y, z, r, g, b;
    map.getPointRGB(i, x, y, z, r, g, b);
    rgb.set(i, byte_of(r), 0);
    rgb.set(i, byte_of(g), 1);
    rgb.set(i, byte_of(b), 2);
  }
}

void add_weights(const mrpt::maps::CPointsMap& map, PointCloud& cloud) {
  Channel& weight = add_channel(cloud, {"weight", ScalarType::u32, 1});
  for (std::size_t i = 0; i < cloud.size(); ++i)
    weight.set(i, static_cast<std::uint32_t>(map.getPointWeight(i)));
}

void add_intensities(const mrpt::maps::CPointsMapXYZI& map, PointCloud& cloud) {
  Channel& intensity = add_channel(cloud, {"intensity", ScalarType::f32, 1});
  for (std::size_t i = 0; i < cloud.size(); ++i) intensity.set(i, map.getPointIntensity_fast(i));
}

Status check(const PointCloud& cloud) {
  for (const Vec3& p : cloud.xyz) {
    for (const double v : p) {
      if (std::abs(v) > kFarthest)
        return make_error(
            ErrorCode::kLimitExceeded,
            "a point lies more than 16 km from the origin: MRPT's float32 would lose millimetres");
    }
  }
  return {};
}

/// Colour of point i as shares of the brightest.
class Colors {
 public:
  explicit Colors(const Channel* rgb) : rgb_(rgb) {}
  [[nodiscard]] float operator()(std::size_t i, std::size_t c) const {
    if (rgb_ == nullptr || rgb_->info.components != 3) return 1;
    if (rgb_->info.scalar == ScalarType::u8) return float(rgb_->get<std::uint8_t>(i, c)) / 255.0F;
    if (rgb_->info.scalar == ScalarType::u16) return float(rgb_->get<std::uint16_t>(i, c)) / 65535.0F;
    return 1;
  }

 private:
  const Channel* rgb_;
};

}  // namespace

PointCloud cloud_of(const mrpt::maps::CPointsMap& map) {
  PointCloud cloud;
  const auto& x = map.getPointsBufferRef_x();
  const auto& y = map.getPointsBufferRef_y();
  const auto& z = map.getPointsBufferRef_z();
  cloud.xyz.resize(std::min({x.size(), y.size(), z.size()}));
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.xyz[i] = {double(x[i]), double(y[i]), double(z[i])};
  if (const auto* colored = dynamic_cast<const mrpt::maps::CColouredPointsMap*>(&map)) {
    add_colors(*colored, cloud);
  } else if (const auto* shining = dynamic_cast<const mrpt::maps::CPointsMapXYZI*>(&map)) {
    add_intensities(*shining, cloud);
  } else if (dynamic_cast<const mrpt::maps::CWeightedPointsMap*>(&map) != nullptr) {
    add_weights(map, cloud);
  }
  return cloud;
}

Status to_points_map(const PointCloud& cloud, mrpt::maps::CSimplePointsMap& map) {
  MAPCODEC_TRY(check(cloud));
  map.clear();
  map.reserve(cloud.size());
  for (const Vec3& p : cloud.xyz) map.insertPointFast(float(p[0]), float(p[1]), float(p[2]));
  map.mark_as_modified();
  return {};
}

Status to_points_map(const PointCloud& cloud, mrpt::maps::CColouredPointsMap& map) {
  MAPCODEC_TRY(check(cloud));
  const Colors color(cloud.find("rgb"));
  map.clear();
  map.reserve(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3& p = cloud.xyz[i];
    map.insertPointRGB(float(p[0]), float(p[1]), float(p[2]), color(i, 0), color(i, 1), color(i, 2));
  }
  map.mark_as_modified();
  return {};
}

}  // namespace mapcodec
