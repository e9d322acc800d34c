// SPDX-License-Identifier: GPL-3.0-or-later
// What of new points a tile does not have already.
#pragma once

#include <memory>
#include <vector>

#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// In shares of an rms promise: what folding pending points may add to their error. The rest of the promise,
/// squared, is for coding them before, and for points that they stand for.
inline constexpr double kFoldedShare = 0.98;

/// New points held against stored ones.
struct Novelty {
  std::vector<std::uint32_t> added;  ///< indices of the points that say something new, ascending
  /// Squared distances [m^2] of the others to the stored points that stand for them, together; an upper
  /// bound. 0 where they are equal to, or in the cells of, stored ones.
  double squared_m2 = 0;
};

/// Stored points of one tile, ready to be asked. What a point is held against depends on the map's promise:
///  - rms R: the nearest stored point. Those farther than 2.5 R are new; of the rest whole pieces of surface
///    are, those first that go most beyond R together, until the root mean square distance of those left is
///    R: the promise holds for all that came in. Few points that have a little more may have it by chance.
///  - max_error: the cell of the lattice. As many points of a cell are new as it has more than are stored.
///  - lossless: equal position and channels, counted in the same way.
/// A scan that comes again thus adds nothing. Threads: const methods from many at once.
class StoredPoints {
 public:
  virtual ~StoredPoints() = default;
  /// @param cloud  laid out as schema.layout() (lossless), or any (others).
  /// @param pending  that folding will code once more: what they stand for gets that error, too.
  virtual void add(const PointCloud& cloud, bool pending) = 0;
  /// @param cloud    as for add. @param rms_m  that may be left, >= the promise where the tile itself has
  /// more; only for rms. @param by_chance_m  none is new where all together have no more than this.
  [[nodiscard]] virtual Novelty look(const PointCloud& cloud, double rms_m, double by_chance_m = 0) const = 0;
  /// Memory that it takes [bytes], about.
  [[nodiscard]] virtual std::size_t bytes() const = 0;
};

/// Farthest along one axis that a stored point may be from one that it stands for [m]; infinity without a
/// rule.
[[nodiscard]] double farthest_known(const MapSchema& schema);

/// @param origin  [m] a point in or near the tile.
/// nullptr for a promise that has no rule (`paper`).
[[nodiscard]] std::unique_ptr<StoredPoints> make_stored_points(const MapSchema& schema, const Vec3& origin);

}  // namespace mapcodec
