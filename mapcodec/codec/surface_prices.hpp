// SPDX-License-Identifier: GPL-3.0-or-later
// What the symbols of a surface tree are expected to cost. Encoder only.
#pragma once

#include "mapcodec/codec/surface_cell.hpp"
#include "mapcodec/codec/surface_model.hpp"
#include "mapcodec/codec/surface_walk.hpp"
#include "mapcodec/entropy/cost_meter.hpp"

namespace mapcodec::surface {

/// What a cell's plane is to it.
enum class PlaneState : int { none = 0, inherited = 1, own = 2 };

/// Prices [bits] by the models as they are, in the contexts that are most likely: neighbours are not known
/// yet.
class Prices {
 public:
  explicit Prices(Models& models) : models_(models) {}

  [[nodiscard]] static CellContext context(const TreeCell& cell) {
    CellContext c;
    c.size = size_of(cell.shape);
    c.crowd = crowd_of(cell.count());
    c.neighbors = 2;
    c.below = c.above = 1;
    return c;
  }
  [[nodiscard]] bool can_be_block(const TreeCell& cell) const {
    return models_.voxel_bits > 0 && cell.count() >= kLeastInBlock &&
           block_levels(cell.shape, models_.voxel_bits) > 0;
  }
  [[nodiscard]] Room room(const TreeCell& cell) const {
    return Room::in(models_.outline, cell.at, cell.shape);
  }
  [[nodiscard]] int voxel_bits() const { return models_.voxel_bits; }

  [[nodiscard]] double no_plane(const CellContext& c, bool inherits) const;
  [[nodiscard]] double plane(const CellContext& c, const Plane& own, const Plane* inherited,
                             const CellShape& shape) const;
  /// Of the flags that make a cell a leaf.
  [[nodiscard]] double leaf(const TreeCell& cell, const CellContext& c, PlaneState plane,
                            bool block = false) const;
  [[nodiscard]] double wedge(const CellContext& c, const Wedge* line) const;
  [[nodiscard]] double noise(const CellContext& c, std::uint8_t v, bool voxels) const;
  /// Of dividing a cell: the flag, which halves hold points, and how many. @param polygon  of the plane,
  /// where there is one.
  [[nodiscard]] double division(const TreeCell& cell, const CellContext& c, PlaneState state,
                                const Plane* plane, const Polygon& polygon, int halves,
                                std::uint32_t lower) const;
  /// Of one division inside a block.
  [[nodiscard]] double block_division(const TreeCell& cell, const Plane* plane, int halves) const;

 private:
  Models& models_;
};

}  // namespace mapcodec::surface
