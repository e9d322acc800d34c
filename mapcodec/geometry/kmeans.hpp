// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace mapcodec {

/// K-means [Lloyd 1982] on colours, started by k-means++ [Arthur, Vassilvitskii 2007] from a fixed seed:
/// deterministic. Centres are learnt on at most 20,000 evenly taken colours.
/// @return the cluster, below `clusters`, of each colour. Threads: pure.
[[nodiscard]] std::vector<std::uint32_t> cluster_colors(std::span<const std::array<std::uint16_t, 3>> colors,
                                                        std::uint32_t clusters);

}  // namespace mapcodec
