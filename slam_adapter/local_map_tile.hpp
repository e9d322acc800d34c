// SPDX-License-Identifier: GPL-3.0-or-later
// One decoded tile of a LocalMap.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "maps/map_archive.hpp"
#include "slam_adapter/local_map_budget.hpp"
#include "slam_adapter/tile_index.hpp"

namespace mapcodec {

/// What is kept of a tile.
struct LocalContent {
  bool points = true;
  bool channels = false;  ///< of the points
  bool patches = false;   ///< of tiles whose codec keeps surfaces (surface, paper)
  bool index = true;      ///< nearest neighbours, of the points and of the patches
};

/// A flat piece of the map: a disc instead of a polygon, 40 bytes.
struct LocalPatch {
  Point3f center{0, 0, 0};  ///< [m from the tile's origin]
  Point3f normal{0, 0, 1};  ///< unit [submap frame]; its side has no meaning
  float radius_m = 0;       ///< the patch lies within this distance of its centre
  float area_m2 = 0;
  float noise_m = 0;  ///< root mean square distance of its points
  std::uint32_t points = 0;
};

/// Points, patches and their indices. Coordinates are float32 from the tile's origin: exact to about 1e-7 of
/// the tile's side. Threads: const.
struct LocalTile {
  TileKey key;
  std::uint32_t submap = 0;
  Vec3 origin{0, 0, 0};           ///< [m, submap frame]
  std::optional<unsigned> level;  ///< set where this is the coarse form
  std::vector<Point3f> points;    ///< [m from origin]
  std::vector<Channel> channels;  ///< of the points; empty in the coarse form
  std::vector<LocalPatch> patches;
  std::vector<Point3f> patch_centers;
  TileIndex point_index, patch_index;
  Box bounds;        ///< of points and patch centres [m, submap frame]
  Reservation held;  ///< what this tile counts for in the budget

  /// [m, submap frame]
  [[nodiscard]] Vec3 from_origin(const Point3f& p) const {
    return {origin[0] + double(p[0]), origin[1] + double(p[1]), origin[2] + double(p[2])};
  }
  [[nodiscard]] Vec3 to_origin(const Vec3& p) const {
    return {p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]};
  }
  /// Of what the vectors and indices hold.
  [[nodiscard]] std::uint64_t bytes() const;
};

/// What loading takes at once, from what the archive says about the tile: its compressed bytes, the points as
/// they are decoded and as they are kept, channels, index. What the decoder needs in between is not in it.
[[nodiscard]] std::uint64_t bytes_to_load(const TileRecord& tile, const MapSchema& schema,
                                          const LocalContent& content, bool coarse);

/// Reads and decodes a tile: its base, then its deltas.
/// @param level     the coarse form at this level of detail (decode_tile_coarsely), equal points once.
/// @param reserved  at least bytes_to_load; shrinks to what is kept and stays with the tile.
/// Errors: as MapArchive::read; ArchiveDamaged (the payload does not decode, or to more points than the
/// archive says); LimitExceeded. Threads: pure but for reading.
[[nodiscard]] Result<std::shared_ptr<const LocalTile>> load_local_tile(
    const MapArchive& archive, const MapSchema& schema, const TileRecord& tile, const LocalContent& content,
    std::optional<unsigned> level, const DecodeLimits& limits, Reservation reserved);

}  // namespace mapcodec
