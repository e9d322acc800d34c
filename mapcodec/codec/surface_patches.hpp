// SPDX-License-Identifier: GPL-3.0-or-later
// The surfaces of a `surface` tile themselves, without the points spread over them: what registration
// (point-to-plane), segmentation and drawing can use.
#pragma once

#include <array>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// A flat, convex piece of surface [m, map frame]. The distance of a point p from its plane is
/// normal . (p - center). Near other patches decoded points leave it, a step at most, to meet theirs.
struct SurfacePatch {
  Vec3 center{0, 0, 0};         ///< centroid of the polygon
  Vec3 normal{0, 0, 1};         ///< unit; its side has no meaning
  std::vector<Vec3> polygon;    ///< 3 to 12 corners, counter-clockwise seen from where `normal` points
  double area_m2 = 0;           ///< > 0
  std::uint64_t points = 0;     ///< that lie on it
  double noise_m = 0;           ///< root mean square distance of those points from it, as decoded
  bool colored = false;         ///< whether `rgb` is known
  std::array<double, 3> rgb{};  ///< mean over its points, 0..255
};

/// The patches of one `surface` tile: its cells (each half of a cell, down to the ones that hold a flat
/// piece), then its occupied voxels. Points that are alone in a cell without a plane lie on no patch.
/// @param bytes    geometry section, may be hostile.
/// @param count    points that the tile's header declares.
/// @param lattice  step_m is the surface step.
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<std::vector<SurfacePatch>> read_surface_patches(ByteSpan bytes, std::uint64_t count,
                                                                     const Quantizer& lattice,
                                                                     const DecodeLimits& limits = {});

inline constexpr std::uint32_t kNoPatch = ~std::uint32_t{0};

/// The same, and which points lie on which patch.
struct SurfacePatchPoints {
  std::vector<SurfacePatch> patches;
  std::vector<VoxelCoord> voxels;       ///< of the points in decode order, as decode_surface gives them
  std::vector<std::uint32_t> patch_of;  ///< of the points in decode order; kNoPatch: on none
};
/// Arguments, errors: as above. Malformed, too, where the tile has no voxels (it has no channels then).
[[nodiscard]] Result<SurfacePatchPoints> read_surface_patch_points(ByteSpan bytes, std::uint64_t count,
                                                                   const Quantizer& lattice,
                                                                   const DecodeLimits& limits = {});

}  // namespace mapcodec
