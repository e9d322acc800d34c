// SPDX-License-Identifier: GPL-3.0-or-later
// Colour of resampled points in as few bits as its error allows. Encoder only.
#pragma once

#include <memory>

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

/// Colour of one tile's decoded points, coded once or several times. Threads: one at a time.
///
/// The error is a mean of distances, not of their squares: what points should have is the median of the
/// originals that they are compared with [Weiszfeld 1937], and what a deviation costs is its square divided
/// by the distance that is there anyway. So rough places get fewer bits than squares would give them.
class SurfaceColorEncoder {
 public:
  /// @param original  of the tile's points. @param encoding  for its points. @param near  of originals and
  /// encoding.decoded. @param ties  of the originals. All but `original` must outlive this.
  SurfaceColorEncoder(Channel original, const NearestPair& near, const SamePositions& ties,
                      const SurfaceEncoding& encoding, Effort effort);
  ~SurfaceColorEncoder();

  /// Codes colour so that its error as measured stays within `bound`, in few bits. If no colours on these
  /// positions meet the bound, a little above the least error. Same arguments, same bytes, whatever was coded
  /// before.
  /// @param slope  > 0: not the bound is the aim. Squared steps [8-bit levels^2] are slope times the usual
  /// distance, and bits are weighed accordingly: so all tiles of a map save the last bit at the same price in
  /// error. Rough tiles may be worse than the bound and smooth ones better.
  [[nodiscard]] SurfaceColor encode(double bound, double slope);

 private:
  class Search;
  std::unique_ptr<Search> search_;
};

}  // namespace mapcodec
