// SPDX-License-Identifier: GPL-3.0-or-later
// Channels of the original points to resampled ones. Encoder only.
#pragma once

#include "mapcodec/cloud/channel.hpp"
#include "mapcodec/quality/grid_nearest.hpp"

namespace mapcodec {

/// Which points stand at the same position: of those any is the nearest.
class SamePositions {
 public:
  explicit SamePositions(std::span<const Vec3> points);
  /// Indices of all points where point `i` is.
  [[nodiscard]] std::span<const std::uint32_t> of(std::uint32_t i) const {
    return std::span(order_).subspan(begin_[i], end_[i] - begin_[i]);
  }

 private:
  std::vector<std::uint32_t> order_, begin_, end_;
};

/// Colour of each decoded point: the mean of the originals whose nearest decoded point it is; where there are
/// none, that of the nearest original.
/// @param original  a colour channel: three u8 or u16. @param near  forth: of each original; back: of each
/// decoded one.
[[nodiscard]] Channel transfer_color(const Channel& original, const NearestPair& near,
                                     const SamePositions& ties);

/// Each decoded point has the value of its nearest original.
[[nodiscard]] Channel transfer_values(const Channel& original, const Nearest& back);

/// Mean RGB distance (0..255) between nearest neighbours, mean of both directions: what `evaluate` measures.
[[nodiscard]] double color_error_between(const Channel& original, const Channel& decoded,
                                         const NearestPair& near, const SamePositions& ties);

}  // namespace mapcodec
