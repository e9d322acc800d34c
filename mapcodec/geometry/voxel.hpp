// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

namespace mapcodec {

/// x, y, z of a voxel, counted from some corner that the context names (usually the tile's base voxel).
using VoxelCoord = std::array<std::uint32_t, 3>;

}  // namespace mapcodec
