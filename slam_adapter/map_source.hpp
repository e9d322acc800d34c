// SPDX-License-Identifier: GPL-3.0-or-later
// A map as a source of points: its tiles one after the other, submaps where their poses put them.
#pragma once

#include "mapcodec/cloud/point_stream.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/map_file.hpp"

namespace mapcodec {

/// Gives a tile a block. Coordinates are f64 where a submap is moved. The map must outlive it.
class MapSource final : public PointSource {
 public:
  explicit MapSource(const MapFile& map);

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override;
  Result<bool> next(PointCloud& block) override;
  Status rewind() override;
  [[nodiscard]] std::uint64_t dropped_points() const override { return 0; }

 private:
  const MapFile& map_;
  PointCloud layout_;
  std::size_t tile_ = 0, at_ = 0;
  PointCloud cloud_;
};

/// Writes the map with all submaps as one, in the map's frame, to a new archive. It promises to the points as
/// they decode now what the map promised to its originals: to those the errors of both add up.
/// An octree beside the points stays as it is.
/// @param options  promise and colour bound are taken from the map.
/// Errors: those of MapFile and of `compress`; Unsupported (a map by the paper's method or of an octree
/// alone; an octree that was moved by a pose); InvalidArgument (the octree's voxels do not fit the new
/// tiles).
[[nodiscard]] Result<CompressReport> flatten_map(const std::string& map_path, const std::string& path,
                                                 CompressOptions options);

}  // namespace mapcodec
