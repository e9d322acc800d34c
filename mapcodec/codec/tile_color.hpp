// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// The tile a colour channel belongs to, as original and as decoded.
struct ColorContext {
  std::span<const Vec3> original;
  std::span<const std::uint32_t> order;  ///< decoded point i comes from original order[i]
  std::span<const VoxelCoord> voxels;    ///< of the decoded points; equal voxels stand side by side
  std::span<const Vec3> decoded;
};

/// The error, measured as below, that is left when all points of a voxel get their mean colour and nothing
/// else is lost: no coding of colours on these positions can do better.
[[nodiscard]] double least_color_error(const Channel& values, const ColorContext& context);

/// Codes colour so that its error *as measured by nearest neighbours* (the evaluation's definition, PAPER.md)
/// stays within channel.bound. Points that share a decoded position cannot be told apart by that measure, so
/// they are given their common mean; the target is tightened until the measure is met, if it can be (see
/// least_color_error).
/// @return `error` is the measured one.
[[nodiscard]] Result<ChannelEncoding> encode_tile_color(const ChannelSchema& channel, const Channel& values,
                                                        const ColorContext& context, Effort effort);

}  // namespace mapcodec
