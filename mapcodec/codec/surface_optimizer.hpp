// SPDX-License-Identifier: GPL-3.0-or-later
// The choices of a surface tree: least squared error + lambda x bits, by recursion. Encoder only.
#pragma once

#include "mapcodec/codec/surface_coverage.hpp"
#include "mapcodec/codec/surface_walk.hpp"

namespace mapcodec::surface {

struct OptimizerSettings {
  double lambda_steps = 1.0;  ///< lambda in squared steps per bit
  double forward_weight =
      0.3;  ///< of the squared distances from originals to decoded points; the rest is of the others
};

/// Chooses cells, planes and wedges for `points` (Morton-sorted with x as the highest bit of each triple,
/// below 2^depth units).
/// @param models  what symbols are expected to cost.
/// @return choices[0] is the root's.
[[nodiscard]] std::vector<Choice> choose_cells(std::span<const Units> points, unsigned depth, Models& models,
                                               const OptimizerSettings& settings);

}  // namespace mapcodec::surface
