// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_seams.hpp"

#include "mapcodec/codec/surface_density.hpp"

namespace mapcodec::surface {
namespace {

// Surfaces farther apart at a face are two: one step; half a step at the faces along the plane's axis, where
// the edge moves with them [heights].
constexpr std::int64_t kMostStep = std::int64_t{kStepUnits} << kHeightBits;
constexpr std::int64_t kMostReach = kMostStep / 2;
constexpr std::int32_t kRamp = kHalf / 2;  // how far from a face a surface is bent [vertex units]

std::int64_t value_at(std::int64_t h, std::int64_t a, std::int64_t b, const Vertex& x) {
  return h + ((a * x.u + b * x.v) >> kVertexBits);
}

std::int64_t steepest(const Plane& p) {
  return std::max(std::abs(std::int64_t{p.a}), std::abs(std::int64_t{p.b}));
}

/// Whether the polygon ends at the lower or upper face along its axis, near to the other surface.
bool meets_along(const Leaf& leaf, const Polygon& polygon, const Bridge& to, bool upper) {
  const Plane& p = leaf.plane;
  const std::int64_t half = half_side(leaf.shape[p.axis]);
  const std::int64_t reach = std::min(kMostReach, steepest(p) / 2);
  const std::int64_t rounding = ((std::abs(std::int64_t{p.a}) + std::abs(std::int64_t{p.b})) >> 14) + 2;
  int on_face = 0;
  for (int i = 0; i < polygon.size; ++i) {
    const Vertex& x = polygon.at[static_cast<std::size_t>(i)];
    const std::int64_t z = value_at(p.h, p.a, p.b, x);
    if ((upper ? half - z : half + z) > rounding) continue;
    if (std::abs(value_at(to.h, to.a, to.b, x)) > reach) return false;
    ++on_face;
  }
  return on_face >= 2;
}

/// The vertex of a face across the plane that is nearest to x.
Vertex on_face(const Plane& plane, unsigned face, const Vertex& x) {
  const std::int32_t at = face % 2 == 1 ? kHalf : -kHalf;
  return face / 2 == (plane.axis + 1u) % 3 ? Vertex{at, x.v} : Vertex{x.u, at};
}

/// Whether the surfaces come near to each other all along the edge of a face across the plane.
bool meets_across(const Leaf& leaf, const Bridge& to, unsigned face) {
  for (const std::int32_t end : {-kHalf, kHalf}) {
    const Vertex x = on_face(leaf.plane, face, {end, end});
    if (std::abs(value_at(to.h, to.a, to.b, x)) > kMostStep) return false;
  }
  return true;
}

/// From a leaf's surface to that of the leaf beyond a face. @param alone  the other one does not bend.
Bridge bridge_to(const Leaf& leaf, const Leaf& other, unsigned face, bool alone, const Outline& outline) {
  const Plane& p = leaf.plane;
  Plane there = seen_from(other.plane, other.at, other.shape, leaf.at, leaf.shape);
  if (!turn_to(there, p.axis, leaf.shape)) return {};
  Bridge b{std::int64_t{there.h} - p.h, std::int64_t{there.a} - p.a, std::int64_t{there.b} - p.b, true};
  const bool meets =
      face / 2 == p.axis
          ? meets_along(leaf, polygon_of(p, leaf.shape, Room::in(outline, leaf.at, leaf.shape)), b,
                        face % 2 == 1)
          : meets_across(leaf, b, face);
  if (!meets) return {};
  const int halved = alone ? 0 : 1;
  return {b.h >> halved, b.a >> halved, b.b >> halved, true};
}

/// Collects what lies beside leaves.
class Joiner {
 public:
  Joiner(std::vector<Leaf>& leaves, Surroundings& around)
      : leaves_(leaves), around_(around), densities_(leaves, around.outline) {}

  /// @param alone  only the first leaf bends.
  void join(std::int32_t from, std::int32_t to, unsigned face, bool bends, bool alone) {
    const Leaf &leaf = leaf_at(from), &other = leaf_at(to);
    if (bends) {
      const Bridge b = bridge_to(leaf, other, face, alone, around_.outline);
      if (b.used) around_.seams[seam_of(from)].bridges[face] = b;
    }
    if (face / 2 == leaf.plane.axis || other.plane.axis != leaf.plane.axis) return;
    if (leaf.count >= kLeastTilted) densities_.add_beside(seam_of(from), from, to, face);
  }
  void finish() {
    for (std::size_t s = 0; s < around_.seams.size(); ++s) around_.seams[s].tilt = densities_.tilt_of(s);
  }

 private:
  const Leaf& leaf_at(std::int32_t i) const { return leaves_[static_cast<std::size_t>(i)]; }
  std::size_t seam_of(std::int32_t i) {
    std::int32_t& seam = leaves_[static_cast<std::size_t>(i)].seam;
    if (seam < 0) {
      seam = static_cast<std::int32_t>(around_.seams.size());
      around_.seams.emplace_back();
    }
    return static_cast<std::size_t>(seam);
  }

  std::vector<Leaf>& leaves_;
  Surroundings& around_;
  DensityTable densities_;
};

Polygon with_edges_bridged(const Leaf& leaf, const Seam& seam, const Room& room, const Polygon& bare) {
  const Plane& p = leaf.plane;
  const Bridge &low = seam.bridges[2 * p.axis], &high = seam.bridges[2 * p.axis + 1];
  if (!low.used && !high.used) return bare;
  const std::int64_t half = half_side(leaf.shape[p.axis]);
  const std::int64_t top = (std::int64_t{room.end[p.axis]} << kHeightBits) - half;
  const std::int64_t bottom = half - std::int64_t{room.begin[p.axis]} * (1 << kHeightBits);
  Polygon r = rectangle_of(room, leaf.shape, p.axis);
  r.rectangle = false;
  clip(r, p.h - top - (high.used ? kMostReach : 0), p.a, p.b);
  clip(r, -p.h - bottom - (low.used ? kMostReach : 0), -std::int64_t{p.a}, -std::int64_t{p.b});
  if (high.used) clip(r, p.h + high.h - half, p.a + high.a, p.b + high.b);
  if (low.used) clip(r, -(p.h + low.h) - half, -(p.a + low.a), -(p.b + low.b));
  return r.size >= 3 && 2 * twice_area(r) >= twice_area(bare) ? r : bare;
}

}  // namespace

Surroundings surroundings_of(std::vector<Leaf>& leaves, std::span<const Joint> joints,
                             const Outline& outline) {
  Surroundings around{outline, {}};
  if (!outline.fitted) return around;
  Joiner joiner(leaves, around);
  for (const Joint& j : joints) {
    const bool alike =
        leaves[static_cast<std::size_t>(j.from)].shape == leaves[static_cast<std::size_t>(j.to)].shape;
    joiner.join(j.from, j.to, j.face, true, !alike);
    joiner.join(j.to, j.from, j.face ^ 1u, alike, false);
  }
  joiner.finish();
  return around;
}

Polygon polygon_of(const Leaf& leaf, const Surroundings& around) {
  if (!leaf.has_plane) return {};
  Room room = leaf.block < 0 ? Room::in(around.outline, leaf.at, leaf.shape) : Room::whole(leaf.shape);
  if (reaches_over(leaf, around.outline)) room.widen(around.outline, leaf.at, leaf.plane.axis);
  Polygon polygon = polygon_of(leaf.plane, leaf.shape, room);
  const Seam* seam = around.of(leaf);
  if (seam != nullptr) polygon = with_edges_bridged(leaf, *seam, room, polygon);
  if (polygon.size >= 3 && leaf.wedged) cut(polygon, leaf.wedge);
  return polygon;
}

bool reaches_over(const Leaf& leaf, const Outline& outline) {
  return outline.borders != 0 && leaf.count >= kLeastJoined && leaf.block < 0;
}

std::int64_t height_of(const Leaf& leaf, const Surroundings& around, const Vertex& x) {
  const Plane& p = leaf.plane;
  if (!around.outline.fitted) return height_at(p, leaf.shape, x);
  const std::int64_t z = value_at(p.h, p.a, p.b, x);
  const Seam* seam = around.of(leaf);
  if (seam == nullptr) return z;
  std::int64_t bent = z;
  for (unsigned f = 0; f < 6; ++f) {
    const Bridge& b = seam->bridges[f];
    if (!b.used) continue;
    const bool upper = f % 2 == 1, along = f / 2 == p.axis;
    const Vertex edge = along ? x : on_face(p, f, x);
    // To the face, and from where on it matters.
    const std::int64_t half = half_side(leaf.shape[p.axis]);
    const std::int64_t from =
        along ? (upper ? half - z : half + z) : std::abs(edge.u - x.u) + std::abs(edge.v - x.v);
    const std::int64_t ramp = along ? steepest(p) / 4 : kRamp;
    if (from >= ramp || ramp <= 0) continue;
    bent += value_at(b.h, b.a, b.b, edge) * std::min(ramp - from, ramp) / ramp;
  }
  return bent;
}

void overlap(const Leaf& leaf, const Outline& outline, Vertex& x) {
  for (unsigned side = 0; side < 2; ++side) {
    const unsigned d = (leaf.plane.axis + 1u + side) % 3;
    std::int32_t& v = side == 0 ? x.u : x.v;
    const auto vertices = [&](std::int64_t units) { return units * (2 * kHalf) >> leaf.shape[d]; };
    const std::int64_t most = vertices(kOverlap);
    const std::int64_t low = vertices(leaf.at[d]) + kHalf + v;
    const std::int64_t high = vertices(std::int64_t{outline.end[d]} - leaf.at[d]) - kHalf - v;
    if (outline.goes_on(d, false) && low < most) v -= static_cast<std::int32_t>(most - low);
    if (outline.goes_on(d, true) && high < most) v += static_cast<std::int32_t>(most - high);
  }
}

}  // namespace mapcodec::surface
