// SPDX-License-Identifier: GPL-3.0-or-later
// One observation of a robot's log, ready for a map; names no type of MRPT.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mapcodec/cloud/point_cloud.hpp"
#include "slam_adapter/local_map.hpp"

namespace mapcodec {

/// An observation with points. A log that moves has its poses in one or more of three places.
struct RawlogFrame {
  std::uint64_t number = 0;  ///< of the observation in the file, counted from 0; frames come in this order
  std::uint64_t group = 0;   ///< observations of one sensory frame or keyframe share it
  std::string class_name;    ///< "CObservation3DRangeScan"
  std::string sensor;        ///< its label
  std::optional<double> stamp_s;          ///< [s since epoch]
  MapPose T_vehicle_sensor;               ///< already applied to `points`
  std::optional<MapPose> T_odom_vehicle;  ///< as summed up from the log's actions and odometry
  std::optional<MapPose> T_map_vehicle;   ///< as the file says (keyframes, robot poses) or MRPT's ICP finds
  PointCloud points;                      ///< [m, vehicle frame], channel "time" [s since epoch] and others
  bool planar = false;                    ///< one line of points: a 2D scan
  std::uint64_t file_offset = 0;          ///< bytes of the file that were read up to here
};

/// What a log holds besides, by class.
struct RawlogClass {
  std::string name;
  std::uint64_t count = 0;
  std::string remark;  ///< why nothing was taken from it; empty where it was used
};

/// What the reader says when it has come to the end.
struct RawlogSummary {
  std::vector<RawlogClass> classes;  ///< in the order of their names
  std::uint64_t observations = 0;
};

}  // namespace mapcodec
