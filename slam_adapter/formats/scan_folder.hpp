// SPDX-License-Identifier: GPL-3.0-or-later
// A folder of 3DTK: scan000.3d, scan001.3d, ... each with its scan000.pose.
#pragma once

#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/formats/text_table.hpp"

namespace mapcodec {

/// Whether `folder` holds a scanNNN.3d.
[[nodiscard]] bool is_scan_folder(const std::string& folder);
/// The scans as one cloud, each moved by its pose: six numbers, position and angles [degrees] about x, y, z
/// as 3DTK defines them (left-handed). Errors: those of a scan; NotFound or Malformed for a pose.
[[nodiscard]] Result<std::unique_ptr<PointSource>> open_scan_folder(const std::string& folder,
                                                                    const ReadOptions& options);
[[nodiscard]] Result<std::uint64_t> scan_folder_bytes(const std::string& folder);
/// The transform of a .pose file's text.
[[nodiscard]] Result<TextTransform> read_scan_pose(const ByteStream& stream);

}  // namespace mapcodec
