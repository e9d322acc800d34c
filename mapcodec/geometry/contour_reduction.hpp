// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace mapcodec {

using Point2 = std::array<double, 2>;

/// Replaces runs of a closed contour that lie on one line by the line's ends [Lowe 1987, section 4.6]: a run
/// is split at its farthest point from the line through its ends; of a run and its parts those are kept whose
/// significance (length over deviation) is greatest, except that no left-out point may be farther than
/// `tolerance_m` from the outline, and that deviations below a quarter of the tolerance count as straight.
/// @param contour  indices into `points`, closed (the last joins the first), at least three.
/// @return kept indices in order; fewer than three if nothing but a line is left. Threads: pure.
[[nodiscard]] std::vector<std::uint32_t> reduce_contour(std::span<const Point2> points,
                                                        std::span<const std::uint32_t> contour,
                                                        double tolerance_m);

}  // namespace mapcodec
