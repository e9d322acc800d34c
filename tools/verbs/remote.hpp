// SPDX-License-Identifier: GPL-3.0-or-later
// Verbs that change a map, for maps of a service: mapcodec://HOST:PORT/MAP. Verbs that only read need nothing
// of this: whatever opens maps takes such a place.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "maps/compaction.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/update.hpp"

namespace mapcodec::cli {

/// Makes places of services known to everything that opens maps. Once, at the beginning.
void use_services();
[[nodiscard]] bool is_remote(const std::string& map);

/// As update_files. What the service does not count stays 0 in the report.
[[nodiscard]] Result<UpdateReport> update_remote(const std::string& map, const UpdateRequest& request,
                                                 std::vector<std::string>& warnings);
/// As merge_maps.
[[nodiscard]] Result<UpdateReport> merge_remote(const std::string& map, const MergeRequest& request,
                                                std::vector<std::string>& warnings);
/// @param submap  empty: everywhere.
[[nodiscard]] Result<UpdateReport> erase_remote(const std::string& map, const std::optional<Erasure>& e,
                                                const std::string& submap);
[[nodiscard]] Result<std::uint64_t> set_poses_remote(
    const std::string& map, const std::vector<std::pair<std::string, PoseChange>>& poses);
/// @return the revision that bears the name; of the commit, if `remove`.
[[nodiscard]] Result<std::uint64_t> snapshot_remote(const std::string& map, const std::string& name,
                                                    bool remove);
[[nodiscard]] Result<std::uint64_t> rollback_remote(const std::string& map, const std::string& revision);
[[nodiscard]] Result<CompactReport> compact_remote(const std::string& map, std::uint64_t keep_last);
/// Compresses into a file here, and sends that as a new map.
[[nodiscard]] Result<CompressReport> compress_remote(const std::vector<std::string>& inputs,
                                                     const std::string& map, CompressOptions options);

}  // namespace mapcodec::cli
