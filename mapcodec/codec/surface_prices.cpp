// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_prices.hpp"

#include <cmath>

namespace mapcodec::surface {

double Prices::no_plane(const CellContext& c, bool inherits) const {
  CostMeter meter;
  models_.own_plane(meter, false, c, inherits);
  return meter.bits();
}

double Prices::plane(const CellContext& c, const Plane& own, const Plane* inherited,
                     const CellShape& shape) const {
  CostMeter meter;
  models_.own_plane(meter, true, c, inherited != nullptr);
  models_.plane(meter, own, inherited, shape, c);
  return meter.bits();
}

double Prices::leaf(const TreeCell& cell, const CellContext& c, PlaneState plane, bool block) const {
  CostMeter meter;
  models_.divided(meter, false, c, static_cast<int>(plane));
  if (can_be_block(cell)) models_.block(meter, block, c, static_cast<int>(plane));
  return meter.bits();
}

double Prices::wedge(const CellContext& c, const Wedge* line) const {
  CostMeter meter;
  models_.wedge(meter, line != nullptr, c);
  if (line != nullptr) models_.wedge_line(meter, *line);
  return meter.bits();
}

double Prices::noise(const CellContext& c, std::uint8_t v, bool voxels) const {
  CostMeter meter;
  models_.noise(meter, v, c, voxels);
  return meter.bits();
}

double Prices::division(const TreeCell& cell, const CellContext& c, PlaneState state, const Plane* plane,
                        const Polygon& polygon, int halves, std::uint32_t lower) const {
  CostMeter meter;
  models_.divided(meter, true, c, static_cast<int>(state));
  const int share = plane != nullptr ? lower_share(polygon, *plane, cell.shape, room(cell), cell.axis()) : -1;
  models_.halves(meter, halves, cell.count(), c, share);
  if (halves == 0) models_.lower_count(meter, lower, cell.count(), share);
  return meter.bits();
}

double Prices::block_division(const TreeCell& cell, const Plane* plane, int halves) const {
  CellContext c = context(cell);
  c.crowd = kUncounted;
  CostMeter meter;
  models_.halves(meter, halves, 2, c,
                 plane != nullptr ? lower_share(*plane, cell.shape, room(cell), cell.axis()) : -1);
  return meter.bits();
}

}  // namespace mapcodec::surface
