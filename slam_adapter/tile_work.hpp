// SPDX-License-Identifier: GPL-3.0-or-later
// One tile while a batch of insertions is coded.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "mapcodec/quality/novelty.hpp"
#include "maps/index_codec.hpp"
#include "slam_adapter/fold_tile.hpp"

namespace mapcodec {

/// A tile of a submap.
struct TilePlace {
  std::uint32_t submap = 0;
  TileKey key;
};
struct TilePlaceLess {
  bool operator()(const TilePlace& a, const TilePlace& b) const {
    return compare_tiles(a.submap, a.key, b.submap, b.key) < 0;
  }
};

/// Points of one scan in one tile.
struct ScanPart {
  std::uint64_t scan = 0;  ///< its number
  PointCloud points;
};

/// Each scan is held against what is stored and against the scans before it, as if each had been committed
/// alone; a scan's own points are never held against each other.
struct TileWork {
  TilePlace place;
  std::vector<ScanPart> scans;           ///< that came in; consumed by look_up
  std::shared_ptr<StoredPoints> stored;  ///< known already, or made by look_up
  std::vector<Bytes> segments;           ///< where it is not known; consumed by look_up
  bool begins = false;                   ///< the tile had nothing before
  bool cap = true;                       ///< known points add nothing
  double allowed_rms_m = 0;              ///< that points may have to what stands for them
  bool by_chance = false;                ///< few points of a scan may have more, as they happen to

  TileBorders borders;               ///< if it will be coded for good
  PointCloud added;                  ///< what is new, of all scans; consumed by code_added
  double added_points = 0;           ///< their number
  double known = 0, known_m2 = 0;    ///< number of the other points, and their squared distances [m^2]
  std::optional<EncodedTile> coded;  ///< of what is new
};

/// Whether points of this scan may have more than `allowed_rms_m`: few scatter about the mean of their tile.
[[nodiscard]] bool is_by_chance(const TileWork& w, const ScanPart& scan);
/// Finds what is new. Threads: those of different tiles at once. Errors: those of decoding.
[[nodiscard]] Status look_up(TileWork& w, const MapSchema& schema, const PendingCoding& coding);
/// Codes what is new, if anything is.
/// @param for_good  a tile that begins is coded once, with the whole
/// promise. Threads: as look_up. Errors: those of encoding.
[[nodiscard]] Status code_added(TileWork& w, const MapSchema& schema, const PendingCoding& coding,
                                bool for_good);

/// Joins the errors of old points and of those of `w`, of which those that only stand for others are some.
/// @param old_points  that came in. @param old_stored  that are stored: the other direction of the RMS is
/// theirs. @param farthest_m  along one axis, of known points.
[[nodiscard]] TileErrors joint_errors(const TileErrors& old, double old_points, double old_stored,
                                      const TileWork& w, double farthest_m);

}  // namespace mapcodec
