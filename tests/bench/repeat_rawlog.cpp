// SPDX-License-Identifier: GPL-3.0-or-later
// A rawlog of any size, made of the observations of real ones with other stamps and poses: the vehicle drives
// on over a plain, 0.25 m and a tenth of a second from one observation to the next.
//   repeat_rawlog OUT.rawlog MEGABYTES IN.rawlog...
#include <mrpt/io/CFileOutputStream.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/obs/registerAllClasses.h>
#include <mrpt/serialization/CArchive.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

using namespace mrpt::obs;

std::vector<CObservation::Ptr> observations_of(const char* path) {
  std::vector<CObservation::Ptr> all;
  CRawlog log;
  if (!log.loadFromRawLogFile(path)) return all;
  for (std::size_t i = 0; i < log.size(); ++i) {
    if (log.getType(i) == CRawlog::etObservation) all.push_back(log.getAsObservation(i));
  }
  return all;
}

CObservationRobotPose::Ptr pose_at(std::size_t i, double stamp) {
  auto pose = CObservationRobotPose::Create();
  pose->timestamp = mrpt::Clock::fromDouble(stamp);
  pose->sensorLabel = "way";
  pose->pose.mean =
      mrpt::poses::CPose3D(0.25 * double(i), 20 * std::sin(0.002 * double(i)), 0, 0.001 * double(i), 0, 0);
  return pose;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  mrpt::obs::registerAllClasses_mrpt_obs();
  mrpt::maps::registerAllClasses_mrpt_maps();
  std::vector<CObservation::Ptr> all;
  for (int i = 3; i < argc; ++i) {
    for (const auto& o : observations_of(argv[i])) all.push_back(o);
  }
  mrpt::io::CFileOutputStream file;
  if (all.empty() || !file.open(argv[1])) return 1;
  auto out = mrpt::serialization::archiveFrom(file);
  const std::uint64_t bytes = std::strtoull(argv[2], nullptr, 10) * 1000000;
  std::size_t i = 0;
  for (; file.getTotalBytesCount() < bytes; ++i) {
    const double stamp = 1.7e9 + 0.1 * double(i);
    all[i % all.size()]->timestamp = mrpt::Clock::fromDouble(stamp);
    out << *pose_at(i, stamp) << *all[i % all.size()];
  }
  std::printf("%zu observations, %llu bytes\n", i,
              static_cast<unsigned long long>(file.getTotalBytesCount()));
  return 0;
}
