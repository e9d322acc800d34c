// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/simplemap_writer.hpp"

#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/maps/CPointsMapXYZI.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/serialization/CArchive.h>

#include "slam_adapter/mrpt/mrpt_pose.hpp"
#include "slam_adapter/mrpt/points_map.hpp"

namespace mapcodec {
namespace {

constexpr std::uint8_t kNewFormat = 0x80, kEndOfObject = 0x88, kLayout = 1;
constexpr const char* kClass = "mrpt::maps::CSimpleMap";

float intensity_of(const Channel& c, std::size_t i) {
  return visit_scalar(c.info.scalar, [&](auto t) { return static_cast<float>(c.get<decltype(t)>(i)); });
}

mrpt::maps::CPointsMap::Ptr with_intensities(const PointCloud& cloud, const Channel& intensity) {
  auto map = mrpt::maps::CPointsMapXYZI::Create();
  map->resize(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3& p = cloud.xyz[i];
    map->setPointFast(i, float(p[0]), float(p[1]), float(p[2]));
    map->setPointIntensity(i, intensity_of(intensity, i));
  }
  map->mark_as_modified();
  return map;
}

Result<mrpt::maps::CPointsMap::Ptr> map_of(const PointCloud& cloud) {
  if (cloud.find("rgb") != nullptr) {
    auto map = mrpt::maps::CColouredPointsMap::Create();
    MAPCODEC_TRY(to_points_map(cloud, *map));
    return mrpt::maps::CPointsMap::Ptr(map);
  }
  const Channel* intensity = cloud.find("intensity");
  if (intensity != nullptr && intensity->info.components == 1) return with_intensities(cloud, *intensity);
  auto map = mrpt::maps::CSimplePointsMap::Create();
  MAPCODEC_TRY(to_points_map(cloud, *map));
  return mrpt::maps::CPointsMap::Ptr(map);
}

}  // namespace

struct SimplemapWriter::State {
  mrpt::io::CFileGZOutputStream file;
  std::uint32_t announced = 0, written = 0;

  Status add(const RawlogFrame& frame) {
    MAPCODEC_ASSIGN(const auto map, map_of(frame.points));
    auto cloud = mrpt::obs::CObservationPointCloud::Create();
    cloud->sensorLabel = frame.sensor;
    if (frame.stamp_s) cloud->timestamp = mrpt::Clock::fromDouble(*frame.stamp_s);
    cloud->pointcloud = map;
    mrpt::obs::CSensoryFrame observations;
    observations.insert(cloud);
    mrpt::poses::CPose3DPDFGaussian pose;
    pose.mean = mrpt_pose(frame.T_map_vehicle.value_or(MapPose{}));
    auto out = mrpt::serialization::archiveFrom(file);
    out << pose << observations;
    ++written;
    return {};
  }

  void begin() {
    auto out = mrpt::serialization::archiveFrom(file);
    const std::string name = kClass;
    out << static_cast<std::uint8_t>(name.size() | kNewFormat);
    out.WriteBuffer(name.data(), name.size());
    out << kLayout << announced;
  }
};

SimplemapWriter::SimplemapWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
SimplemapWriter::SimplemapWriter(SimplemapWriter&&) noexcept = default;
SimplemapWriter::~SimplemapWriter() = default;

namespace {
/// What MRPT throws while it writes is the disk's fault.
template <class F>
Status guarded(F&& f) {
  try {
    return f();
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kCannotWrite, std::string("MRPT cannot write: ") + e.what());
  }
}
}  // namespace

Result<SimplemapWriter> SimplemapWriter::create(const std::string& path, std::uint32_t keyframes) {
  auto state = std::make_unique<State>();
  state->announced = keyframes;
  MAPCODEC_TRY(guarded([&]() -> Status {
    if (!state->file.open(path)) return make_error(ErrorCode::kCannotWrite, "cannot be written");
    state->begin();
    return {};
  }));
  return SimplemapWriter(std::move(state));
}

Status SimplemapWriter::add(const RawlogFrame& frame) {
  return guarded([&] { return state_->add(frame); });
}

Status SimplemapWriter::finish() {
  if (state_->written != state_->announced)
    return make_error(ErrorCode::kInvalidArgument, "other keyframes than announced");
  return guarded([&]() -> Status {
    auto out = mrpt::serialization::archiveFrom(state_->file);
    out << kEndOfObject;
    state_->file.close();
    return {};
  });
}

}  // namespace mapcodec
