// SPDX-License-Identifier: GPL-3.0-or-later
// One channel of one tile to bytes.
#pragma once

#include <span>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

struct ChannelEncoding {
  Bytes bytes;
  Channel decoded;  ///< what decode_channel will give
  double error =
      0;  ///< colour: mean distance of paired values on a scale of 0..255 (u16 channels whose values exceed
          ///< 255 are divided by 257 for it); others: largest absolute error; exact: 0
};

/// Encodes a channel that is kept exactly or within a bound.
/// @param schema  kept == exact or bounded.
/// @param values  N values in decoded order. @param voxels  of the same N points: Morton-sorted, equal ones
/// adjacent,
///                coordinates below 2^21.
/// Errors: InvalidArgument (sizes differ, kept otherwise, bound not finite or negative). Threads: pure; same
/// input, same bytes.
[[nodiscard]] Result<ChannelEncoding> encode_channel(const ChannelSchema& schema, const Channel& values,
                                                     std::span<const VoxelCoord> voxels, Effort effort);

/// Whether `values` are what `schema` says, one for each voxel. Errors: InvalidArgument. Threads: pure.
[[nodiscard]] Status check_channel(const ChannelSchema& schema, const Channel& values,
                                   std::span<const VoxelCoord> voxels);

}  // namespace mapcodec
