// SPDX-License-Identifier: GPL-3.0-or-later
// Encoder of the `surface` geometry: as many points as went in, resampled from surfaces (FORMAT.md 10).
#pragma once

#include <span>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/tile_borders.hpp"
#include "mapcodec/codec/surface_layout.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

struct SurfaceSettings {
  Effort effort = Effort::standard;
  TileBorders borders;
  SurfaceTrade trade;
};

/// A tile's bytes and what its decoder will make of them.
struct SurfaceEncoding {
  Bytes bytes;  ///< read by decode_surface
  surface::Header header;
  std::vector<surface::SubUnits> points;  ///< as below, from header.base
  std::vector<Vec3> decoded;              ///< [m, map frame] as decode_surface gives them
};

/// Encodes the positions of one tile. Pure: same input, same bytes, any thread. The points are in tree order:
/// without channels that is how they are decoded.
/// @param xyz      points [m, map frame]; not empty, all within 2^21 / 32 steps of each other per axis.
/// @param lattice  step_m: the surface step. The error follows it: the RMS is about half to twice the step.
/// Errors: Empty; InvalidArgument (step or bit price not positive, weight not between 0 and 1, non-finite or
/// too distant points).
[[nodiscard]] Result<SurfaceEncoding> encode_surface(std::span<const Vec3> xyz, const Quantizer& lattice,
                                                     const SurfaceSettings& settings);

/// Lets the decoder sort the points by voxels of 2^voxel_shift sub-units, for channels (FORMAT.md 10.6).
/// Changes one byte of `bytes`, and nothing else: the new order is returned.
[[nodiscard]] surface::VoxelOrder set_voxels(SurfaceEncoding& encoding, std::uint8_t voxel_shift);

}  // namespace mapcodec
