// SPDX-License-Identifier: GPL-3.0-or-later
// What a LocalMap holds at one moment, for as long as somebody looks at it.
#pragma once

#include <memory>
#include <vector>

#include "maps/submap_pose.hpp"
#include "slam_adapter/local_map_tile.hpp"

namespace mapcodec {

/// A point (or patch) of a view, near to what was asked for.
struct LocalNeighbor {
  std::uint32_t tile = 0;   ///< index into LocalMapView::tiles()
  std::uint32_t index = 0;  ///< of the point or patch in its tile
  double distance_m = 0;
};

/// An immutable snapshot: stays as it is, and its tiles in memory (and in the budget), while the map moves
/// on. Threads: const methods from many at once.
class LocalMapView {
 public:
  struct Tile {
    std::shared_ptr<const LocalTile> content;
    RigidMotion T_map_submap;
  };
  /// A tile that cannot be had: damaged, or too large for the budget.
  struct Fault {
    TileKey key;
    std::uint32_t submap = 0;
    Error error;
  };

  [[nodiscard]] const std::vector<Tile>& tiles() const { return tiles_; }
  [[nodiscard]] const std::vector<Fault>& faults() const { return faults_; }
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  /// The robot's position that the tiles were chosen for [m, map frame].
  [[nodiscard]] const Vec3& center() const { return center_; }
  /// Tiles within the radius that are not there yet; that are there in their coarse form only.
  [[nodiscard]] std::size_t missing() const { return missing_; }
  [[nodiscard]] std::size_t coarse() const { return coarse_; }
  /// Everything within the radius is there in full (tiles with faults aside).
  [[nodiscard]] bool ready() const { return planned_ && missing_ == 0 && coarse_ == 0; }
  /// Everything within the radius is there, be it coarse.
  [[nodiscard]] bool coarse_ready() const { return planned_ && missing_ == 0; }
  /// The budget does not hold everything within the radius: the nearest tiles are there.
  [[nodiscard]] bool starved() const { return starved_; }

  [[nodiscard]] std::size_t points() const;
  [[nodiscard]] std::size_t patches() const;
  /// Of the tiles in this view [bytes].
  [[nodiscard]] std::uint64_t bytes() const;

  /// The `most` points nearest to `p` [m, map frame] within the radius, the nearest first, over all tiles.
  /// Needs LocalContent::index. None where `p` is not finite.
  [[nodiscard]] std::vector<LocalNeighbor> nearest(const Vec3& p, std::size_t most = 1,
                                                   double radius_m = INFINITY) const;
  /// All points within the radius, the nearest first. @param radius_m  finite.
  [[nodiscard]] std::vector<LocalNeighbor> within(const Vec3& p, double radius_m) const;
  /// The same for the centres of patches.
  [[nodiscard]] std::vector<LocalNeighbor> nearest_patches(const Vec3& p, std::size_t most = 1,
                                                           double radius_m = INFINITY) const;

  /// [m, map frame]
  [[nodiscard]] Vec3 point(const LocalNeighbor& n) const;
  struct Plane {
    Vec3 center{0, 0, 0};  ///< [m, map frame]
    Vec3 normal{0, 0, 1};  ///< unit, map frame
    const LocalPatch* patch = nullptr;
  };
  [[nodiscard]] Plane plane(const LocalNeighbor& n) const;
  /// All points with their channels [m, map frame]; of coarse tiles without. Channels are there only if
  /// every tile has them.
  [[nodiscard]] PointCloud cloud() const;

 private:
  friend class LocalMapBuilder;
  enum class What { points, patches };
  [[nodiscard]] std::vector<LocalNeighbor> search(const Vec3& p, std::size_t most, double radius_m,
                                                  What what) const;

  std::vector<Tile> tiles_;
  std::vector<Fault> faults_;
  std::uint64_t revision_ = 0, sequence_ = 0;
  Vec3 center_{0, 0, 0};
  std::size_t missing_ = 0, coarse_ = 0;
  bool planned_ = false, starved_ = false;
};

}  // namespace mapcodec
