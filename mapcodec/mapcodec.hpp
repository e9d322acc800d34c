// SPDX-License-Identifier: GPL-3.0-or-later
// The few calls that a program needs: write a map, open it, read a region, measure. Everything else is behind
// these.
//
//   write_map(cloud, path, options)   a cloud in memory -> an archive           (slam_adapter/compress.hpp)
//   compress_files(inputs, path, ...) files of points -> an archive, any size
//   MapFile::open(path)               -> .read(region), .read_tile(i), .schema(), .summary()
//   evaluate(original, decoded, ...)  -> RMS, largest error, PSNR, colour and density error
//
// All return Result<T>: look at ok() before value(). Lengths are metres, colours 0..255, nothing is thrown.
#pragma once

#include "mapcodec/cloud/cloud_source.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/quality/evaluation.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/decompress.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/verify.hpp"

namespace mapcodec {

/// Compresses a cloud in memory into a new archive. Errors: as `compress`.
[[nodiscard]] inline Result<CompressReport> write_map(const PointCloud& cloud, const std::string& path,
                                                      const CompressOptions& options = {}) {
  CloudSource source(cloud);
  return compress(source, path, options);
}

}  // namespace mapcodec
