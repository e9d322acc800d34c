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

/// One coding, and what it says of the next one.
struct CoarseColors {
  Bytes bytes;      ///< a colour section
  Channel decoded;  ///< in the order of the voxels
  /// First points of runs without symbols inside, and the end of all: only the means of these are coded.
  std::vector<std::uint32_t> runs;
  std::uint8_t trust = 0;  ///< in predicted differences, 1/16: what would have been best
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
  /// 8-bit level, 1..2^24 - 1. @param trust  in predicted differences, 1/16, at most kMostTrust.
  [[nodiscard]] CoarseColors encode(const ColorAims& aims, std::uint32_t step, double price,
                                    std::uint8_t trust);
  static constexpr std::uint8_t kUsualTrust = 12;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapcodec
