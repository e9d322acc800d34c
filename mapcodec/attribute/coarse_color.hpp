// SPDX-License-Identifier: GPL-3.0-or-later
// Colours coded in so few bits that most splits have no symbols: each symbol is weighed against what it
// costs. Encoder only; the decoder is decode_color.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/attribute/color_space.hpp"

namespace mapcodec {

/// What colours points should have, and how much each counts.
struct ColorAims {
  std::vector<std::array<float, 3>> rgb;  ///< 8-bit levels
  std::vector<float> weights;             ///< of the squared distance to it; >= 0
};

/// Codes one cloud several times. Threads: one at a time.
class CoarseColorEncoder {
 public:
  /// @param voxels  Morton-sorted, equal ones adjacent, coordinates below 2^21, not empty; must outlive this.
  /// @param info  of the channel: three u8 or u16.
  CoarseColorEncoder(std::span<const VoxelCoord> voxels, const ChannelInfo& info, ColorScale scale);
  ~CoarseColorEncoder();
  /// Least sum over the points of weight * distance^2 + `price` * bits, about.
  /// @param aims   one for each voxel, in their order. @param step  of orthonormal coefficients, 1/16 of an
  /// 8-bit level, 1..2^24 - 1. @return bytes and what they decode to; `error` is left 0.
  [[nodiscard]] ChannelEncoding encode(const ColorAims& aims, std::uint32_t step, double price);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapcodec
