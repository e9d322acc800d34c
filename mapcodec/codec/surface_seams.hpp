// SPDX-License-Identifier: GPL-3.0-or-later
// How leaves fit to those beside them: where the surface of one goes on in the other, and how dense the
// points are beyond (FORMAT.md 10.5).
#pragma once

#include <span>
#include <vector>

#include "mapcodec/codec/surface_walk.hpp"

namespace mapcodec::surface {

/// What to add to a leaf's plane at a face so that it meets the surface beyond.
struct Bridge {
  std::int64_t h = 0, a = 0, b = 0;
  bool used = false;
};

/// What the leaves beside it change about a leaf.
struct Seam {
  std::array<Bridge, 6> bridges;  ///< by face
  Tilt tilt;
};

/// Memory that joints and what comes of them take: leaves of kLeastJoined points have six faces.
inline constexpr std::uint64_t kJoinedBytesPerPoint =
    2 * (6 * sizeof(Joint) + sizeof(Seam) + 256) / kLeastJoined;

/// What lies around the leaves of a tile.
struct Surroundings {
  Outline outline;
  std::vector<Seam> seams;
  [[nodiscard]] const Seam* of(const Leaf& leaf) const {
    return leaf.seam < 0 ? nullptr : &seams[static_cast<std::size_t>(leaf.seam)];
  }
};

/// Gives leaves with `joints` their `seam`. @param joints  of the walk; older tiles have none.
[[nodiscard]] Surroundings surroundings_of(std::vector<Leaf>& leaves, std::span<const Joint> joints,
                                           const Outline& outline);

/// The leaf's piece of its plane, cut by its wedge; no corner if there is none.
[[nodiscard]] Polygon polygon_of(const Leaf& leaf, const Surroundings& around);

/// Height of a leaf's surface over a vertex.
[[nodiscard]] std::int64_t height_of(const Leaf& leaf, const Surroundings& around, const Vertex& x);

/// Whether overlap() is for this leaf.
[[nodiscard]] bool reaches_over(const Leaf& leaf, const Outline& outline);

/// Moves a vertex near a border of the tile outwards: there the surfaces of both tiles overlap, each half as
/// dense.
void overlap(const Leaf& leaf, const Outline& outline, Vertex& x);

}  // namespace mapcodec::surface
