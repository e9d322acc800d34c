// SPDX-License-Identifier: GPL-3.0-or-later
// A map as a simplemap of MRPT's: each submap a keyframe.
#pragma once

#include <string>

#include "slam_adapter/decompress.hpp"

namespace mapcodec {

/// Whether the name asks for one: .simplemap, .simplemap.gz.
[[nodiscard]] bool is_simplemap_name(const std::string& path);

/// Writes every submap that has points as a keyframe with its pose and first stamp; points stay in the
/// submap's frame. What MRPT's maps hold beside points is kept: "rgb", else "intensity"; see
/// SimplemapWriter. Memory: one submap. There is never a half file.
/// Errors: those of MapFile; Empty; CannotWrite; Unsupported (built without MRPT); LimitExceeded (a point
/// more than 16 km from its submap's origin).
[[nodiscard]] Result<DecompressReport> decompress_simplemap(const std::string& map_path,
                                                            const std::string& path,
                                                            std::optional<std::uint64_t> revision,
                                                            const ReadSettings& settings);

}  // namespace mapcodec
