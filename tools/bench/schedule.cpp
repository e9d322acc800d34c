// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/schedule.hpp"

#include <algorithm>
#include <functional>
#include <queue>

namespace mapcodec::bench {

double makespan(const TaskGraph& graph, std::size_t cores) {
  cores = std::max<std::size_t>(cores, 1);
  const std::size_t window = std::max<std::size_t>(graph.tiles_in_flight * cores, 1);
  std::priority_queue<double, std::vector<double>, std::greater<>> free_at;
  for (std::size_t i = 0; i < cores; ++i) free_at.push(graph.serial_before_s);
  std::vector<double> handed_on;
  double last = graph.serial_before_s;
  for (std::size_t i = 0; i < graph.tile_s.size(); ++i) {
    const double room = i >= window ? handed_on[i - window] : 0;
    const double end = std::max(free_at.top(), room) + graph.tile_s[i];
    free_at.pop();
    free_at.push(end);
    last = std::max(last, end) + graph.serial_per_tile_s;
    handed_on.push_back(last);
  }
  return last + graph.serial_after_s;
}

double serial_seconds(const TaskGraph& graph) {
  return graph.serial_before_s + graph.serial_after_s +
         graph.serial_per_tile_s * static_cast<double>(graph.tile_s.size());
}

}  // namespace mapcodec::bench
