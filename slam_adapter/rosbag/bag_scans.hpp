// SPDX-License-Identifier: GPL-3.0-or-later
// A ROS 1 bag scan by scan: for maps whose scans are submaps with poses, and for whoever finds the poses
// himself.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "slam_adapter/formats/byte_stream.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/rosbag/scan_pose.hpp"

namespace mapcodec {

/// One sensor_msgs/PointCloud2.
struct BagScan {
  std::string topic;
  std::string frame;                     ///< of the sensor
  std::int64_t stamp_ns = 0;             ///< since epoch; when it was recorded where the message has none
  std::optional<ScanPose> T_map_sensor;  ///< nothing only where poses are not used (`has_poses`)
  PointCloud points;                     ///< [m, sensor frame], laid out as `layout`; NaN are kept
};

/// Threads: one at a time.
class BagScans {
 public:
  /// Errors: Unsupported, Malformed, Truncated, Empty (no cloud; no cloud with a pose), InvalidArgument
  /// (topics or poses that the bag does not have).
  [[nodiscard]] static Result<std::unique_ptr<BagScans>> open(std::unique_ptr<ByteStream> stream,
                                                              const BagOptions& options);
  /// The same for a file; messages begin with its path.
  [[nodiscard]] static Result<std::unique_ptr<BagScans>> open(const std::string& path,
                                                              const BagOptions& options);
  virtual ~BagScans() = default;

  /// What all topics have in common; coordinates as stored. No point.
  [[nodiscard]] virtual const PointCloud& layout() const = 0;
  [[nodiscard]] virtual bool has_poses() const = 0;
  /// False at the end. Scans without a pose (where poses are used) or of another layout are left out and
  /// counted. Errors: those of the messages, with the chunk's byte.
  [[nodiscard]] virtual Result<bool> next(BagScan& scan) = 0;
  virtual void rewind() = 0;
  /// Things a user should hear; complete after the last scan.
  [[nodiscard]] virtual std::vector<std::string> warnings() const = 0;
};

/// All scans as one cloud in the map's frame (f64, normals turned too), or as they lie where the bag has no
/// poses. Errors: as BagScans::open; Empty where no scan has a pose comes from `next`.
[[nodiscard]] Result<std::unique_ptr<PointSource>> open_bag(std::unique_ptr<ByteStream> stream,
                                                            const std::string& name,
                                                            const ReadOptions& options);

}  // namespace mapcodec
