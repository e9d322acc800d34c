// SPDX-License-Identifier: GPL-3.0-or-later
// Of several codings of each tile, those that keep a promise together and are smallest.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace mapcodec {

/// What one coding of a tile costs and loses.
struct CodingFigures {
  double bits = 0;                   ///< infinite: not to be taken
  double forward = 0, backward = 0;  ///< sums of squared distances [m^2], to and from the decoded points
};
using Codings = std::vector<CodingFigures>;

/// What all tiles together may lose.
struct MixtureLimit {
  double forward = 0, backward = 0;  ///< sums of squared distances [m^2]
};

/// For each tile the number of the coding that is cheapest when a bit has to save `bit_price` [m^2] of the
/// mean of both directions. Every tile has a coding.
[[nodiscard]] std::vector<std::size_t> mixture_at(std::span<const Codings> tiles, double bit_price);

/// What a choice loses.
[[nodiscard]] MixtureLimit lost_by(std::span<const Codings> tiles, std::span<const std::size_t> choice);

/// The choice of nearly the fewest bits within the limit: by one Lagrangian for all tiles, and then tile by
/// tile what still fits. Nothing if not even the most exact codings do.
[[nodiscard]] std::optional<std::vector<std::size_t>> cheapest_within(std::span<const Codings> tiles,
                                                                      const MixtureLimit& limit);

}  // namespace mapcodec
