// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_points.hpp"

namespace mapcodec::surface {
namespace {

SubUnits center_of(const Leaf& leaf) {
  SubUnits c;
  for (unsigned d = 0; d < 3; ++d) {
    c[d] = static_cast<std::int32_t>((std::int64_t{leaf.at[d]} << kSubUnitBits) +
                                     (std::int64_t{1} << (leaf.shape[d] + kSubUnitBits - 1)));
  }
  return c;
}

}  // namespace

void append_points(const Leaf& leaf, const Surroundings& around, std::vector<Vertex>& scratch,
                   std::vector<SubUnits>& out) {
  const SubUnits center = center_of(leaf);
  const Polygon polygon = polygon_of(leaf, around);
  if (polygon.size < 3) {
    out.insert(out.end(), leaf.count, center);
    return;
  }
  scratch.clear();
  const Seam* seam = around.of(leaf);
  spread(polygon, leaf.plane, leaf.shape, leaf.count, seam != nullptr ? seam->tilt : Tilt{}, scratch);
  const bool at_border = reaches_over(leaf, around.outline);
  const unsigned k = leaf.plane.axis, u = (k + 1) % 3, v = (k + 2) % 3;
  constexpr int kDown = kVertexBits + 1 - kSubUnitBits;
  for (std::size_t i = 0; i < scratch.size(); ++i) {
    Vertex& x = scratch[i];
    if (at_border) overlap(leaf, around.outline, x);
    const std::int64_t height = height_of(leaf, around, x) + noise_offset(leaf.noise, i);
    SubUnits p = center;
    p[u] += static_cast<std::int32_t>(((std::int64_t{x.u} << leaf.shape[u]) + (1 << (kDown - 1))) >> kDown);
    p[v] += static_cast<std::int32_t>(((std::int64_t{x.v} << leaf.shape[v]) + (1 << (kDown - 1))) >> kDown);
    p[k] += static_cast<std::int32_t>((height + (1 << (kHeightBits - kSubUnitBits - 1))) >>
                                      (kHeightBits - kSubUnitBits));
    out.push_back(p);
  }
}

}  // namespace mapcodec::surface
