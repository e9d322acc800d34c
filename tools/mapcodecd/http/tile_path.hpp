// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "maps/service/map_service.hpp"

namespace mapcodec::daemon {

/// Name of a tile in a URL: LEVEL_X_Y_Z, of submaps other than the first SUBMAP_LEVEL_X_Y_Z, decimal.
[[nodiscard]] std::string tile_path(const TileSelection::Key& key);
/// Nothing for anything that tile_path does not give.
[[nodiscard]] std::optional<TileSelection::Key> parse_tile_path(std::string_view text);

}  // namespace mapcodec::daemon
