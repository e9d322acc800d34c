// SPDX-License-Identifier: GPL-3.0-or-later
// Channels of the original points to resampled ones, and colour within its bound there. Encoder only.
#pragma once

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/codec/surface_encoder.hpp"
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

struct SurfaceColor {
  Bytes bytes;               ///< a channel's section
  std::uint8_t voxel_shift;  ///< that it was coded on
  double error = 0;          ///< as color_error_between
};

/// Codes colour so that its error as measured stays within channel.bound, in few bits: on voxels as coarse as
/// the bound allows, all points of one alike. If no colours on these positions meet the bound, a little above
/// the least error.
/// @param encoding  for its points; unchanged. @param near  of originals and encoding.decoded.
/// @param loss  > 0: not the bound is the aim but the error D = (loss + sqrt(loss^2 + 4 least^2)) / 2, with
/// the least error of these positions: D^2 = least^2 + x^2 is what a loss x of coding gives, and where bits
/// fall with log x, x^2 = loss * D is where all tiles have one slope of bits against error. So rough tiles
/// may be worse than the bound and smooth ones better, and the map takes fewer bits for the same mean.
[[nodiscard]] Result<SurfaceColor> encode_surface_color(const ChannelSchema& channel, const Channel& original,
                                                        const NearestPair& near, const SamePositions& ties,
                                                        const SurfaceEncoding& encoding, Effort effort,
                                                        double loss = 0);

}  // namespace mapcodec
