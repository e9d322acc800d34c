// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "maps/archive_state.hpp"
#include "maps/compaction.hpp"

namespace mapcodec {

/// Puts in the place of each tile of `state` whose segments are damaged its newest older version that is
/// whole and that no revision since has removed. Tiles without one stay as they are.
/// @return the versions that were replaced, in order, with `saved_revision`. Errors: Unreadable.
[[nodiscard]] Result<std::vector<LostTile>> rescue_tiles(const TileStore& store, ArchiveState& state);

}  // namespace mapcodec
