// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>

#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {

enum class Format {
  unknown,
  pcd,
  ply,
  las,
  vtk,
  pts,
  ptx,
  xyz,
  kitti,
  laz,
  e57,
  gzip,
  zip,
  bzip2,
  xz,
  zstd,
  zlib7,
  rosbag,
  ros2_db,
  mcap,
  rawlog,
  simplemap,
  mrpt_object,
  octomap_bt,
  octomap_ot,
  pcap,
  hdf5,
  image
};

struct FormatInfo {
  Format format;
  const char* name;    ///< "PCD"
  const char* advice;  ///< what a user should do first; null where the format is read
};

/// What the bytes are, and only where they do not say, what the name says. Never fails: unknown.
[[nodiscard]] Format recognise(const ByteStream& stream, const std::string& name);
[[nodiscard]] const FormatInfo& format_info(Format format);
/// The extension in lower case, with its point; "" if none.
[[nodiscard]] std::string extension_of(const std::string& path);

}  // namespace mapcodec
