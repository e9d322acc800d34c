// SPDX-License-Identifier: GPL-3.0-or-later
// What updates left pending in tiles becomes part of them for good.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "slam_adapter/fold_tile.hpp"
#include "slam_adapter/rms_coding.hpp"

namespace mapcodec {

struct FoldTask {
  std::vector<Bytes> segments;  ///< base, then deltas
  TileErrors errors;
  Box bounds;           ///< [m, submap frame]
  TileBorders borders;  ///< in the submap's frame: where other tiles lie beside it
};

// What was coded for good is not coded again together with what is pending: each coding with loss spends from
// the promise, and under one account both as one took 1.03 to 2.8 times the bytes of one more segment (three
// maps that were begun by a compressed scan of a third to a half of their points). Even if the errors of old
// segments together were known exactly, it would be 0.95 to 1.4 times.

/// Folds the pending segments of tiles, and erasures where that loses nothing. Where positions lie on the
/// map's lattice (max_error) or are exact (lossless), all of a tile becomes one base; else (rms, or colours
/// within a bound) segments that were folded before stay bit for bit, and all pending ones together become
/// one more. Surfaces go on where the task names tiles beside it; what stays does so as it was coded, so of
/// two tiles the one that was folded later may be the only one that covers their seam. The promise of an rms
/// holds for the folded points of all tiles together.
/// @param rms_m  that coding pending points may add; only for rms.
/// @return per tile: nothing if there is nothing to fold; `points` 0 if nothing is left of the tile.
/// Same input, same bytes, however many threads `run` uses.
/// Errors: those of decoding and encoding; PromiseBroken if no coding keeps it.
[[nodiscard]] Result<std::vector<std::optional<Fold>>> fold_tiles(std::span<const FoldTask> tasks,
                                                                  const MapSchema& schema, double rms_m,
                                                                  const RunEach& run);

}  // namespace mapcodec
