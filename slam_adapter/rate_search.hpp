// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>

#include "mapcodec/codec/tile_codec.hpp"
#include "parallel/tile_set.hpp"

namespace mapcodec {

/// The voxel side [m] with which `tiles` take about `bits_per_point` bits, channels included, found by coding
/// a sample of at most four tiles, evenly spread. Errors: those of encoding; InvalidArgument where the
/// channels alone take more.
[[nodiscard]] Result<double> find_step_for_bits(double bits_per_point, const TileSet& tiles,
                                                const MapSchema& schema, const TileSettings& settings,
                                                Arena& arena, const std::atomic<bool>* stop);

/// The largest voxel side <= schema.step_m on which colour `channel` (an index into schema.channels, bounded)
/// can keep its bound: coarser voxels hold points of too different colours at one position. Measured on the
/// same sample. Errors: those of encoding.
[[nodiscard]] Result<double> find_step_for_color(std::size_t channel, const TileSet& tiles,
                                                 const MapSchema& schema, Arena& arena);

}  // namespace mapcodec
