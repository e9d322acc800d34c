// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/attribute/color_walk.hpp"
#include "mapcodec/base/byte_writer.hpp"

namespace mapcodec {

/// Encodes a colour channel (is_color) as a "colour" section (FORMAT.md 8.5) whose mean distance to
/// `values`, point by point on a scale of 0..255, is at most `bound` > 0, and as near below it as the search
/// finds.
/// @param voxels  Morton-sorted, coordinates below 2^21. Threads: pure.
[[nodiscard]] ChannelEncoding encode_color(const Channel& values, double bound,
                                           std::span<const VoxelCoord> voxels, Effort effort);

/// How the numbers of a colour channel are scaled.
[[nodiscard]] ColorScale color_scale_of(const Channel& values);

/// The fields before the symbols. @param root  mean of all points, in 1/16 level.
void write_color_head(ByteWriter& out, const ColorSettings& settings, const ColorPoint& root);

/// encode_color for one cloud and several bounds: what does not depend on the bound is worked out once.
/// Threads: one at a time.
class ColorEncoder {
 public:
  /// @param values, voxels  as above, not empty; must outlive this.
  ColorEncoder(const Channel& values, std::span<const VoxelCoord> voxels);
  ~ColorEncoder();
  [[nodiscard]] ChannelEncoding encode(double bound, Effort effort);

 private:
  class Search;
  std::unique_ptr<Search> search_;
};

}  // namespace mapcodec
