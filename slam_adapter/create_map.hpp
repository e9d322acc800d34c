// SPDX-License-Identifier: GPL-3.0-or-later
// A new map that will grow by updates.
#pragma once

#include "mapcodec/cloud/point_stream.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/map_updater.hpp"

namespace mapcodec {

/// Begins an archive without tiles whose promise, lattice, channels and tile size fit `first`, which stands
/// for what will come; it is read to its end, and none of it is inserted. Nothing stands at `path` before the
/// first commit.
/// @param options  as for compress; a target of size is refused. @param arena  must outlive the updater.
/// @param warnings  out: what will not be kept, one sentence each.
/// Errors: those of the source; Empty; InvalidArgument; Unsupported (`paper`); CannotWrite.
[[nodiscard]] Result<MapUpdater> create_map(const std::string& path, PointSource& first,
                                            const CompressOptions& options, Arena& arena,
                                            const UpdateSettings& settings,
                                            std::vector<std::string>& warnings);

/// The schema that such a map would have. @param path  of the archive; nothing is written to it.
[[nodiscard]] Result<MapSchema> schema_for_growth(PointSource& first, const CompressOptions& options,
                                                  Arena& arena, const std::string& path,
                                                  std::vector<std::string>& warnings);

}  // namespace mapcodec
