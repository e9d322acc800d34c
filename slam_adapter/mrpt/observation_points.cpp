// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/observation_points.hpp"

#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationRotatingScan.h>
#include <mrpt/obs/CObservationVelodyneScan.h>

#include <cstring>

#include "slam_adapter/mrpt/mrpt_pose.hpp"
#include "slam_adapter/mrpt/points_map.hpp"

namespace mapcodec {
namespace {

using namespace mrpt::obs;

const ChannelInfo kRgb{"rgb", ScalarType::u8, 3}, kIntensity{"intensity", ScalarType::f32, 1},
    kRing{"ring", ScalarType::u16, 1}, kTime{"time", ScalarType::f64, 1};

void add_layout(PointCloud& cloud, const ChannelInfo& info) {
  cloud.channels.push_back({info, Bytes(info.stride() * cloud.size())});
}

template <class T>
void push(Channel& c, T value) {
  c.data.resize(c.data.size() + sizeof(T));
  c.set(c.size() - 1, value);
}

/// MRPT reads flags as bytes: in a damaged file one may be neither false nor true, which no bool may be.
bool is_set(const bool& flag) {
  unsigned char byte = 0;
  std::memcpy(&byte, &flag, 1);
  return byte != 0;
}

std::string scan_2d(const CObservation2DRangeScan& o, const ProjectionSettings& s, RawlogFrame& f) {
  f.planar = true;
  const bool shines = o.hasIntensity();
  if (shines) add_layout(f.points, kIntensity);
  if (s.layout_alone) return {};
  const double step = o.getScanSize() > 1 ? double(o.aperture) / double(o.getScanSize() - 1) : 0;
  const double turn = is_set(o.rightToLeft) ? 1 : -1;
  for (std::size_t i = 0; i < o.getScanSize(); ++i) {
    const double range = double(o.getScanRange(i));
    if (!o.getScanRangeValidity(i) || !(range > 0) || !(range < double(o.maxRange))) continue;
    const double angle = turn * (double(i) * step - 0.5 * double(o.aperture));
    f.points.xyz.push_back({range * std::cos(angle), range * std::sin(angle), 0});
    if (shines) push(f.points.channels[0], static_cast<float>(o.getScanIntensity(i)));
  }
  return {};
}

std::string range_image(CObservation3DRangeScan& o, const ProjectionSettings& s, RawlogFrame& f) {
  if (!is_set(o.hasRangeImage) && !is_set(o.hasPoints3D)) return "no range image and no points";
  const bool colored = is_set(o.hasRangeImage) && is_set(o.hasIntensityImage);
  if (colored) add_layout(f.points, kRgb);
  if (s.layout_alone) return {};
  o.load();
  if (!is_set(o.hasRangeImage)) {
    const std::size_t n = std::min({o.points3D_x.size(), o.points3D_y.size(), o.points3D_z.size()});
    for (std::size_t i = 0; i < n; ++i)
      f.points.xyz.push_back({double(o.points3D_x[i]), double(o.points3D_y[i]), double(o.points3D_z[i])});
    return {};
  }
  T3DPointsProjectionParams projection;
  projection.decimation = s.decimation;
  mrpt::maps::CColouredPointsMap map;
  o.unprojectInto(map, projection);
  PointCloud cloud = cloud_of(map);
  if (!colored) cloud.channels.clear();
  f.points = std::move(cloud);
  return {};
}

// MRPT's interface has no virtual destructor; nobody deletes through it.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"
/// Takes MRPT's points as they are made, without a second copy.
class VelodynePoints final : public CObservationVelodyneScan::PointCloudStorageWrapper {
 public:
  explicit VelodynePoints(PointCloud& cloud) : cloud_(cloud) {}
  void add_point(float x, float y, float z, uint8_t intensity, const mrpt::system::TTimeStamp& time,
                 float /*azimuth*/, uint16_t ring) override {
    cloud_.xyz.push_back({double(x), double(y), double(z)});
    push(cloud_.channels[0], static_cast<float>(intensity));
    push(cloud_.channels[1], ring);
    push(cloud_.channels[2], mrpt::Clock::toDouble(time));
  }

 private:
  PointCloud& cloud_;
};
#pragma GCC diagnostic pop

/// Points that were made when the log was written; the packets are gone.
void ready_points(const CObservationVelodyneScan& o, PointCloud& cloud) {
  const auto& p = o.point_cloud;
  const std::size_t n = std::min({p.x.size(), p.y.size(), p.z.size()});
  const double stamp = mrpt::Clock::toDouble(o.timestamp);
  for (std::size_t i = 0; i < n; ++i) {
    cloud.xyz.push_back({double(p.x[i]), double(p.y[i]), double(p.z[i])});
    push(cloud.channels[0], i < p.intensity.size() ? static_cast<float>(p.intensity[i]) : 0.0F);
    push(cloud.channels[1], static_cast<std::uint16_t>(i < p.laser_id.size() ? p.laser_id[i] : 0));
    push(cloud.channels[2], i < p.timestamp.size() ? mrpt::Clock::toDouble(p.timestamp[i]) : stamp);
  }
}

std::string velodyne(CObservationVelodyneScan& o, const ProjectionSettings& s, RawlogFrame& f) {
  if (o.scan_packets.empty() && o.point_cloud.size() == 0) return "no packets and no points";
  for (const ChannelInfo& c : {kIntensity, kRing, kTime}) add_layout(f.points, c);
  if (s.layout_alone) return {};
  if (o.scan_packets.empty()) {
    ready_points(o, f.points);
    return {};
  }
  CObservationVelodyneScan::TGeneratePointCloudParameters parameters;
  parameters.generatePerPointTimestamp = true;
  VelodynePoints points(f.points);
  o.generatePointCloud(points, parameters);
  return {};
}

/// Elevation of each ring [rad]: the observation does not hold it, its scanner's calibration does.
std::vector<double> elevations(const CObservationRotatingScan& o) {
  if (o.rowCount == 1) return {0};
  const bool vlp = o.lidarModel.find("VLP") != std::string::npos;
  const bool hdl32 =
      o.lidarModel.find("HDL-32") != std::string::npos || o.lidarModel.find("HDL32") != std::string::npos;
  if (!vlp && !hdl32) return {};
  std::vector<double> angles;
  for (const auto& laser :
       VelodyneCalibration::LoadDefaultCalibration(vlp ? "VLP16" : "HDL32").laser_corrections)
    angles.push_back(mrpt::DEG2RAD(laser.verticalCorrection));
  if (angles.size() != o.rowCount) angles.clear();
  return angles;
}

/// MRPT's conversion of Velodyne scans makes as many columns as there are single returns, and fills the first
/// ones, one for each firing of all lasers: the sweep is spread over those.
double columns_of_sweep(const CObservationRotatingScan& o, bool velodyne) {
  if (!velodyne || o.rowCount < 2) return std::max(1, o.columnCount - 1);
  const auto firings = static_cast<Eigen::Index>(o.columnCount / o.rowCount);
  for (Eigen::Index c = firings; c < o.rangeImage.cols(); ++c) {
    for (Eigen::Index r = 0; r < o.rangeImage.rows(); ++r) {
      if (o.rangeImage(r, c) != 0) return std::max(1, o.columnCount - 1);
    }
  }
  return std::max<double>(1, double(firings));
}

std::string rotating(const CObservationRotatingScan& o, const ProjectionSettings& s, RawlogFrame& f) {
  f.planar = o.rowCount == 1;
  const auto rows = o.rangeImage.rows(), columns = o.rangeImage.cols();
  const std::vector<double> elevation = elevations(o);
  if (rows == 0 || columns == 0) return "no ranges";
  if (std::size_t(rows) > elevation.size())
    return "the elevation of its rings is not known (scanner '" + o.lidarModel.substr(0, kLongestLabel) +
           "')";
  const bool shines = o.intensityImage.rows() == rows && o.intensityImage.cols() == columns;
  if (shines) add_layout(f.points, kIntensity);
  add_layout(f.points, kRing);
  if (s.layout_alone) return {};
  const bool clockwise = rows > 1;  // Velodyne's azimuths
  const double step = o.azimuthSpan / columns_of_sweep(o, rows > 1);
  for (decltype(o.rangeImage.cols()) c = 0; c < columns; ++c) {
    const double azimuth = (clockwise ? -1 : 1) * (o.startAzimuth + double(c) * step);
    for (decltype(o.rangeImage.rows()) r = 0; r < rows; ++r) {
      const double range = double(o.rangeImage(r, c)) * o.rangeResolution;
      if (!(range > 0) || !(range <= o.maxRange) || (rows > 1 && range < o.minRange)) continue;
      const double flat = range * std::cos(elevation[std::size_t(r)]);
      f.points.xyz.push_back(
          {flat * std::cos(azimuth), flat * std::sin(azimuth), range * std::sin(elevation[std::size_t(r)])});
      if (shines) push(f.points.channels[0], static_cast<float>(o.intensityImage(r, c)));
      push(f.points.channels.back(), static_cast<std::uint16_t>(r));
    }
  }
  return {};
}

std::string point_cloud(const CObservationPointCloud& o, const ProjectionSettings& s, RawlogFrame& f) {
  o.load();
  if (!o.pointcloud) return "no points";
  f.points = cloud_of(*o.pointcloud);
  if (s.layout_alone) f.points = f.points.like();
  return {};
}

std::string sensor_points(CObservation& o, const ProjectionSettings& s, RawlogFrame& f) {
  if (auto* scan = dynamic_cast<CObservation2DRangeScan*>(&o)) return scan_2d(*scan, s, f);
  if (auto* image = dynamic_cast<CObservation3DRangeScan*>(&o)) return range_image(*image, s, f);
  if (auto* scan = dynamic_cast<CObservationVelodyneScan*>(&o)) return velodyne(*scan, s, f);
  if (auto* scan = dynamic_cast<CObservationRotatingScan*>(&o)) return rotating(*scan, s, f);
  if (auto* cloud = dynamic_cast<CObservationPointCloud*>(&o)) return point_cloud(*cloud, s, f);
  return "holds no points";
}

/// Into the vehicle's frame, in float32 as MRPT's maps keep them.
void move_to_vehicle(PointCloud& cloud, const mrpt::poses::CPose3D& T_vehicle_sensor) {
  for (Vec3& p : cloud.xyz) {
    Vec3 q{0, 0, 0};
    T_vehicle_sensor.composePoint(p[0], p[1], p[2], q[0], q[1], q[2]);
    for (std::size_t d = 0; d < 3; ++d) p[d] = double(float(q[d]));
  }
}

void add_time(RawlogFrame& f) {
  if (f.points.find("time") != nullptr) return;
  add_layout(f.points, kTime);
  Channel& time = f.points.channels.back();
  for (std::size_t i = 0; i < f.points.size(); ++i) time.set(i, f.stamp_s.value_or(0));
}

}  // namespace

bool gives_points(const CObservation& o) {
  return dynamic_cast<const CObservation2DRangeScan*>(&o) != nullptr ||
         dynamic_cast<const CObservation3DRangeScan*>(&o) != nullptr ||
         dynamic_cast<const CObservationVelodyneScan*>(&o) != nullptr ||
         dynamic_cast<const CObservationRotatingScan*>(&o) != nullptr ||
         dynamic_cast<const CObservationPointCloud*>(&o) != nullptr;
}

std::string take_points(CObservation& o, const ProjectionSettings& settings, RawlogFrame& f) {
  f.sensor = o.sensorLabel.substr(0, kLongestLabel);
  if (o.timestamp != INVALID_TIMESTAMP) f.stamp_s = mrpt::Clock::toDouble(o.timestamp);
  mrpt::poses::CPose3D T_vehicle_sensor;
  o.getSensorPose(T_vehicle_sensor);
  std::string why = sensor_points(o, settings, f);
  if (!why.empty()) return why;
  f.T_vehicle_sensor = pose_of(T_vehicle_sensor);
  move_to_vehicle(f.points, T_vehicle_sensor);
  add_time(f);
  return why;
}

}  // namespace mapcodec
