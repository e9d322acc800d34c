// SPDX-License-Identifier: GPL-3.0-or-later
// Patches to one mesh without slits.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mapcodec/codec/surface_patches.hpp"

namespace mapcodec {

struct SurfaceMesh {
  std::vector<Vec3> vertices;                       ///< [m, map frame]
  std::vector<std::array<std::uint8_t, 3>> rgb;     ///< of the vertices; empty if no patch has a colour
  std::vector<std::array<std::uint32_t, 3>> faces;  ///< counter-clockwise seen from a patch's normal
};

/// Triangles of all patches. Corners of different patches within `gap_m` of each other (less on patches that
/// are smaller than that) become one vertex at their mean; a vertex that near to another patch's edge is put
/// into the edge: so cells of different size close on their common face, in one tile and across tiles. The
/// sides of neighbouring patches do not always agree: see orient_faces.
/// A vertex has the mean colour of its patches. Deterministic in the order of the patches. Threads: pure.
[[nodiscard]] SurfaceMesh weld_patches(std::span<const SurfacePatch> patches, double gap_m);

}  // namespace mapcodec
