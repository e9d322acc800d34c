// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>

#include "mapcodec/codec/tile_codec.hpp"
#include "parallel/tile_set.hpp"

namespace mapcodec {

/// The voxel side [m] with which `tiles` take about `bits_per_point` bits, channels included, found by coding a sample of
/// at most eight tiles, evenly spread.
/// Errors: those of encoding; InvalidArgument where the channels alone take more.
[[nodiscard]] Result<double> find_step_for_bits(double bits_per_point, const TileSet& tiles, const MapSchema& schema,
                                                const TileSettings& settings, Arena& arena,
                                                const std::atomic<bool>* stop);

}  // namespace mapcodec
