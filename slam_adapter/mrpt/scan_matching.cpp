// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/scan_matching.hpp"

#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/slam/CMetricMapBuilderICP.h>

#include <utility>

namespace mapcodec {

struct ScanMatcher::Builder {
  mrpt::slam::CMetricMapBuilderICP icp;
  mrpt::poses::CPose2D odometry;
  bool moved = false;
};

ScanMatcher::ScanMatcher() : builder_(std::make_unique<Builder>()) {
  auto& icp = builder_->icp;
  icp.setVerbosityLevel(mrpt::system::LVL_ERROR);
  mrpt::maps::CSimplePointsMap::TMapDefinition points;
  points.insertionOpts.minDistBetweenLaserPoints = 0.02F;  // bounds what a place adds, however often seen
  points.insertionOpts.fuseWithExisting = false;
  points.insertionOpts.isPlanarMap = false;
  points.insertionOpts.also_interpolate = false;
  icp.ICP_options.mapInitializers.push_back(points);
  icp.ICP_options.matchAgainstTheGrid = false;
  icp.ICP_options.insertionLinDistance = 0.3;
  icp.ICP_options.insertionAngDistance = mrpt::DEG2RAD(10.0);
  icp.ICP_options.localizationLinDistance = 0;
  icp.ICP_options.localizationAngDistance = 0;
  icp.ICP_options.minICPgoodnessToAccept = 0.4;
  icp.ICP_params.maxIterations = 80;
  icp.ICP_params.minAbsStep_trans = 1e-4;
  icp.ICP_params.minAbsStep_rot = 1e-4;
  icp.ICP_params.thresholdDist = 0.7;
  icp.ICP_params.thresholdAng = mrpt::DEG2RAD(2.0);
  icp.ICP_params.smallestThresholdDist = 0.05;
  icp.ICP_params.ALFA = 0.5;
  icp.ICP_params.doRANSAC = false;
  icp.ICP_params.corresponding_points_decimation = 2;
  icp.initialize();
}

ScanMatcher::~ScanMatcher() = default;

void ScanMatcher::move(const mrpt::poses::CPose3D& step) {
  builder_->odometry = builder_->odometry + mrpt::poses::CPose2D(step);
  builder_->moved = true;
}

mrpt::poses::CPose3D ScanMatcher::match(mrpt::obs::CObservation& scan) {
  if (std::exchange(builder_->moved, false)) {
    auto odometry = mrpt::obs::CObservationOdometry::Create();
    odometry->timestamp = scan.timestamp;
    odometry->odometry = builder_->odometry;
    builder_->icp.processObservation(odometry);
  }
  // The builder keeps what it is given.
  builder_->icp.processObservation(
      std::dynamic_pointer_cast<mrpt::obs::CObservation>(scan.duplicateGetSmartPtr()));
  return builder_->icp.getCurrentPoseEstimation()->getMeanVal();
}

}  // namespace mapcodec
