// SPDX-License-Identifier: GPL-3.0-or-later
// What the measured tiles would take on more cores than this machine has.
#pragma once

#include <cstddef>
#include <vector>

namespace mapcodec::bench {

/// The pipeline's task graph: everything before the tiles is serial, tiles are independent, and what comes
/// out is handed on one by one in order.
struct TaskGraph {
  double serial_before_s = 0;    ///< reading, survey, tiling
  std::vector<double> tile_s;    ///< work of each tile on one core, in the order they start
  double serial_per_tile_s = 0;  ///< handing on one tile: writing, appending
  double serial_after_s = 0;     ///< index and commit
  std::size_t tiles_in_flight =
      4;  ///< per core: a tile starts only when so many times `cores` before it are handed on
};

/// Seconds until all is done on `cores` cores: each tile goes to the core that is free first (list
/// scheduling, Graham 1966), tiles in their order. Caches, memory and other processes are left out, so it is
/// a lower estimate.
[[nodiscard]] double makespan(const TaskGraph& graph, std::size_t cores);

/// Seconds that no number of cores takes away.
[[nodiscard]] double serial_seconds(const TaskGraph& graph);

}  // namespace mapcodec::bench
