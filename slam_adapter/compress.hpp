// SPDX-License-Identifier: GPL-3.0-or-later
// Points in, an archive out: the whole way from a source to a committed map file.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "mapcodec/cloud/point_stream.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "maps/map_archive.hpp"
#include "parallel/progress.hpp"
#include "slam_adapter/coding_plan.hpp"
#include "slam_adapter/formats/bag_options.hpp"

namespace mapcodec {

class MapWriter;

struct CompressOptions {
  PromiseKind promise = PromiseKind::rms;
  double promise_m = 0.01;                      ///< rms or max_error [m]
  std::optional<double> target_bits_per_point;  ///< find the promise (rms) that gives this size
  std::optional<double> target_ratio;           ///< the same, as archive bytes / raw bytes
  CodecChoice codecs =
      CodecChoice::cheapest;  ///< of an rms promise: for each tile the cheapest, or one for all
  double color_error = 10;    ///< mean RGB distance allowed, 0..255; 0 = exact
  /// The bound was asked for, not left at its default: where resampled positions cannot keep it, they are
  /// made finer. Otherwise what is reachable is recorded as the bound, with a warning.
  bool color_error_asked = false;
  std::vector<std::string> channels{"all"};  ///< "all", "none" or names
  bool constants =
      true;  ///< a channel that is the same for all points is stored once, for good; not by maps that grow
  double tile_size_m = 0;  ///< 0: from the density, 100,000 points a tile, 600,000 of surfaces
  Effort effort = Effort::standard;
  bool keep_order = false;  ///< lossless: also the order of points
  bool keep_counts = true;  ///< false: points in one voxel become one
  PaperSettings paper;
  double unit_m = 1;                   ///< metres per unit of the input files (3DTK's centimetres: 0.01)
  BagOptions bag;                      ///< of ROS bags among the input files
  int threads = 0;                     ///< 0: all
  std::uint64_t max_memory_bytes = 0;  ///< 0: half of the machine's memory
  std::string temp_folder;             ///< spill files; empty: the output's folder
  std::uint64_t input_bytes = 0;       ///< of the source, for the record
  bool overwrite = false;
  ProgressCallback progress;
  const std::atomic<bool>* stop = nullptr;
  std::function<Status(MapWriter&)>
      beside;  ///< what else goes into the archive with the points; may be empty
};

struct CompressReport {
  std::uint64_t points = 0, dropped_points = 0;
  double seconds = 0;  ///< wall time of everything
  double survey_seconds = 0, tiling_seconds = 0, search_seconds = 0, tiles_seconds = 0, commit_seconds = 0;
  int codings = 0;                   ///< of the whole map, until the promise was met
  std::uint64_t geometry_bytes = 0;  ///< of the tiles, without channels
  std::vector<double> tile_seconds;  ///< encoding time of each tile on its core, in Morton order
  int threads = 0;
  std::vector<std::string> warnings;  ///< what was dropped, coarsened or doubtful; one sentence each
};

/// Compresses all points of `source` into a new archive at `path` (written beside it, then renamed: there is
/// never a half file). The same source and options give the same bytes for any number of threads. Errors:
/// those of the source; Empty (no finite point); InvalidArgument; CannotWrite; Cancelled.
[[nodiscard]] Result<CompressReport> compress(PointSource& source, const std::string& path,
                                              const CompressOptions& options);

/// The same for files of any supported format, together one map.
[[nodiscard]] Result<CompressReport> compress_files(const std::vector<std::string>& inputs,
                                                    const std::string& path, CompressOptions options);

/// Bytes that the ratio refers to: 12 per xyz plus the kept channels (rgb with alpha: 4).
[[nodiscard]] std::uint64_t raw_bytes_per_point(const MapSchema& schema);

}  // namespace mapcodec
