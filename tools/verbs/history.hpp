// SPDX-License-Identifier: GPL-3.0-or-later
// What the verbs about revisions share: names, times, tiles.
#pragma once

#include <cstdint>
#include <string>

#include "maps/map_archive.hpp"
#include "tools/verbs/report.hpp"

namespace mapcodec::cli {

/// Now [s since epoch], or SOURCE_DATE_EPOCH where that is set: the time that a commit is stamped with.
[[nodiscard]] std::int64_t commit_time();
/// "2026-11-23 07:52:11", UTC; "-" for 0.
[[nodiscard]] std::string time_text(std::int64_t timestamp_s);
/// Names come from files: control characters become '?', long ones are cut to `width` characters.
[[nodiscard]] std::string shown(const std::string& name, std::size_t width = 255);
/// "0: 12,-3,0", with "submap/" before it if that is not the first; "unplaced".
[[nodiscard]] std::string tile_text(std::uint32_t submap, const TileKey& key);
/// {"submap", "level", "x", "y", "z"}.
[[nodiscard]] Json tile_json(std::uint32_t submap, const TileKey& key);
/// Names of the snapshots of a revision, with commas between.
[[nodiscard]] std::string names_of(const MapInfo& info, std::uint64_t revision);
/// Indented; bytes that are no UTF-8 are replaced.
[[nodiscard]] std::string json_text(const Json& json);

}  // namespace mapcodec::cli
