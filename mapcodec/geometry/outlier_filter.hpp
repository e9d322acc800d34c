// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// Radius outlier removal: which of `subset` have at least `neighbors` others of `subset` within `radius_m`.
/// @param xyz  [m], finite, less than 2^20 radii from (0, 0, 0).
/// @return one flag per entry of `subset`. Threads: pure.
[[nodiscard]] std::vector<bool> find_supported_points(std::span<const Vec3> xyz,
                                                      std::span<const std::uint32_t> subset,
                                                      std::uint32_t neighbors, double radius_m);

}  // namespace mapcodec
