// SPDX-License-Identifier: GPL-3.0-or-later
// Point files of the outside world, streamed: blocks in, blocks out, memory bounded by a block.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/cloud/point_stream.hpp"
#include "slam_adapter/formats/bag_options.hpp"

namespace mapcodec {

struct ReadOptions {
  bool keep_nonfinite =
      false;  ///< keep points with a NaN or infinite coordinate instead of dropping and counting them
  /// Metres per unit of the file: multiplies x, y, z (3DTK's centimetres: 0.01). Anything but 1 makes the
  /// coordinates f64, since a product is no longer a number that the file stored.
  double unit_m = 1;
  BagOptions bag = {};
};

/// Opens a point file as blocks of at most 65,536 points.
///
/// The format is recognised by content (PCD, PLY, LAS, LAZ, E57, ROS 1 bags, VTK legacy, PTS, PTX, columns of
/// numbers); the name decides only where content is silent (KITTI .bin). A folder of 3DTK scans (scanNNN.3d
/// with scanNNN.pose) is opened as one cloud with the poses applied, left-handed and in the files' unit; a
/// single .3d file is read as it lies. So is a map folder of Autoware (pointcloud_map_metadata.yaml with its
/// tiles). Coordinates are f32, f64 or fixed as the file stores them; text without a declared type is f64.
/// Channels: packed PCD colour becomes "rgb" (u8x3: red, green, blue) and "alpha" (its fourth byte);
/// red/green/blue become "rgb"; normal_x/y/z and nx/ny/nz become "normal"; the bits of LAS flags become u8
/// channels; other names stay. Text columns are judged by their first 4,096 lines. Lines beyond the number
/// that a PTS file announces are left out with a warning (such files are common); elsewhere data beyond the
/// announced points are Malformed. PTX cells of 0 0 0 ("no return") count as dropped whatever
/// `keep_nonfinite` says.
/// Every error message begins with the path. Errors: NotFound, Unreadable (directory, permission), Empty (no
/// byte, no point), Truncated, Malformed (with line or byte), Unsupported (zipped, ROS 2 bags, ...:
/// says what to run first). What is wrong beyond the header comes from `next`. Threads: one at a time per
/// source.
[[nodiscard]] Result<std::unique_ptr<PointSource>> open_source(const std::string& path,
                                                               const ReadOptions& options = {});

/// The same over bytes in memory, which must outlive the source; `name` stands in messages and decides as a
/// path would.
[[nodiscard]] Result<std::unique_ptr<PointSource>> open_source_memory(ByteSpan bytes, std::string name,
                                                                      const ReadOptions& options = {});

/// Several sources as one, in order. Channels are matched by name and type and follow the first source's
/// order; coordinate formats that differ widen to f64. A channel "alpha" that not all have is left out with a
/// warning, unless `every_channel`. Errors: InvalidArgument (no source; another channel that not all have,
/// naming file and channel).
[[nodiscard]] Result<std::unique_ptr<PointSource>> concatenate(
    std::vector<std::unique_ptr<PointSource>> sources, bool every_channel = false);

struct WriteOptions {
  bool ascii = false;       ///< PCD and PLY as text
  bool compressed = false;  ///< PCD as binary_compressed (held in memory until `finish`)
};

/// Opens `path` for writing `total_points` points laid out as `layout`; the extension decides the format:
/// .pcd .ply .las .xyz .txt .pts .bin .vtk. Writes beside it under a temporary name; `finish` syncs and
/// renames; without `finish` the temporary is removed. What is written reads back with the same coordinate
/// bits and, but for what `unwritten_channels` says, the same channels. Errors: InvalidArgument (unknown
/// extension, option that the format lacks, count that differs from `total_points`, a coordinate outside
/// LAS's 32 bits), CannotWrite (naming the path). Threads: one at a time per sink.
[[nodiscard]] Result<std::unique_ptr<PointSink>> open_sink(const std::string& path, const PointCloud& layout,
                                                           std::uint64_t total_points,
                                                           const WriteOptions& options = {});

/// What writing `layout` to `path` would lose or change, one sentence each; empty if nothing.
[[nodiscard]] std::vector<std::string> unwritten_channels(const std::string& path, const PointCloud& layout);

/// "PCD", "PLY", "LAS", "LAZ", "E57", "ROS bag", "VTK", "PTS", "PTX", "XYZ", "KITTI", "3DTK", "Autoware";
/// also formats that are known but not read: "gzip", "MCAP (ROS 2 bag)", ... Errors: NotFound, Unreadable,
/// Empty, Unsupported (not recognised).
[[nodiscard]] Result<std::string> detect_format(const std::string& path);

/// Size of the file, or of the scans or tiles in a folder [bytes]. Errors: NotFound, Unreadable.
[[nodiscard]] Result<std::uint64_t> input_bytes(const std::string& path);

}  // namespace mapcodec
