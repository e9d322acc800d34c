// SPDX-License-Identifier: GPL-3.0-or-later
// Colour of resampled points in as few bits as its error allows. Encoder only.
#pragma once

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/codec/surface_encoder.hpp"
#include "mapcodec/codec/surface_transfer.hpp"

namespace mapcodec {

struct SurfaceColor {
  Bytes bytes;               ///< a channel's section
  std::uint8_t voxel_shift;  ///< that it was coded on
  double error = 0;          ///< as color_error_between
  double least_error = 0;    ///< of any colours on these positions, about
};

/// Codes colour so that its error as measured stays within channel.bound, in few bits. If no colours on these
/// positions meet the bound, a little above the least error.
///
/// The error is a mean of distances, not of their squares: what points should have is the median of the
/// originals that they are compared with [Weiszfeld 1937], and what a deviation costs is its square divided
/// by the distance that is there anyway. So rough places get fewer bits than squares would give them.
/// @param encoding  for its points; unchanged. @param near  of originals and encoding.decoded.
/// @param slope  > 0: not the bound is the aim. Squared steps [8-bit levels^2] are slope times the usual
/// distance, and bits are weighed accordingly: so all tiles of a map save the last bit at the same price in
/// error. Rough tiles may be worse than the bound and smooth ones better.
[[nodiscard]] Result<SurfaceColor> encode_surface_color(const ChannelSchema& channel, const Channel& original,
                                                        const NearestPair& near, const SamePositions& ties,
                                                        const SurfaceEncoding& encoding, Effort effort,
                                                        double slope = 0);

}  // namespace mapcodec
