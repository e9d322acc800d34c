// SPDX-License-Identifier: GPL-3.0-or-later
// The map around a robot, in bounded memory: what a SLAM frontend holds of a map that is larger than memory.
//
//   Arena arena(2);
//   auto map = LocalMap::open("city.mapc", {.radius_m = 50, .memory_bytes = 256 << 20}, arena);
//   map->move_to(T_map_robot);                  // each scan; returns at once
//   map->wait_ready(0.05);                      // at most 50 ms
//   auto view = map->view();                    // stays as it is while a registration uses it
//   for (auto& n : view->nearest(p, 5)) use(view->point(n));
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "maps/map_archive.hpp"
#include "parallel/arena.hpp"
#include "slam_adapter/local_map_view.hpp"

namespace mapcodec {

struct LocalMapSettings {
  double radius_m = 50;                                   ///< tiles within it are loaded, the nearest first
  double keep_radius_m = 0;                               ///< tiles within it stay in views; 0: 1.25 x radius
  std::uint64_t memory_bytes = std::uint64_t{256} << 20;  ///< for tiles, see LocalMap
  double ahead_s = 3;                    ///< tiles on the way are fetched this early; 0: none
  LocalContent content;                  ///< what is kept of a tile
  std::optional<unsigned> coarse_level;  ///< first load what is near at this level of detail
  DecodeLimits limits;
};

/// A rigid motion: p_map = rotation * p_robot + translation.
struct MapPose {
  Vec3 translation_m{0, 0, 0};
  std::array<double, 4> rotation_xyzw{0, 0, 0, 1};  ///< unit quaternion
};

struct LocalMemory {
  std::uint64_t used = 0, peak = 0, limit = 0;  ///< [bytes]
};

/// The decoded tiles around a pose.
///
/// Memory: tiles being read (compressed bytes, decoded points and channels, index) and tiles that are held,
/// by this object or by views that somebody still has, together never exceed `memory_bytes`: the bytes are
/// reserved before a tile is read. Not in it: the archive's index of tiles (about 300 bytes each) and what a
/// decoder needs for a moment beside its output. When memory is short, the tiles go whose use is longest
/// ago, then those that are wanted last; what lies within the radius and is nearest stays.
///
/// Threads: all methods from many at once. A thread of its own decides, the arena's threads load; between
/// two tiles they look for what is needed most. No method but `open`, `over` and `refresh` reads a file.
/// Where others wait for the arena, too, give it more than one thread: loading keeps one of them busy.
class LocalMap {
 public:
  /// Opens the newest revision of a map file.
  /// @param arena  must outlive the map.
  /// Errors: as MapArchive::open; ArchiveDamaged (schema); InvalidArgument (radius not positive, keep radius
  /// smaller, no memory, nothing to keep).
  [[nodiscard]] static Result<std::unique_ptr<LocalMap>> open(const std::string& path,
                                                              const LocalMapSettings& settings, Arena& arena);
  /// Over an archive that is open already, at its revision. Errors: as open.
  [[nodiscard]] static Result<std::unique_ptr<LocalMap>> over(std::shared_ptr<const MapArchive> archive,
                                                              const LocalMapSettings& settings, Arena& arena);
  /// Waits for the tiles that are being read. Views outlive the map.
  ~LocalMap();
  LocalMap(const LocalMap&) = delete;
  LocalMap& operator=(const LocalMap&) = delete;

  /// The robot is here now. Returns at once: loading goes on in the background.
  /// @param stamp_s  [s] of any clock, to know the speed; nothing: the time of the call.
  /// Errors: InvalidArgument (pose not finite, quaternion not of length 1 within 1e-6).
  [[nodiscard]] Status move_to(const MapPose& T_map_robot, std::optional<double> stamp_s = std::nullopt);

  /// The newest snapshot; never null. It may be of the pose before: see wait_ready. Never blocks for long.
  [[nodiscard]] std::shared_ptr<const LocalMapView> view() const;

  /// Waits until the view has everything within the radius of the last pose, at most `timeout_s`.
  /// @return true: it has; false: time is up, or nobody called move_to.
  /// Errors: LimitExceeded (the budget does not hold it: at once, for the nearest tiles are all there will
  /// be). Damaged tiles are no error here: see LocalMapView::faults.
  [[nodiscard]] Result<bool> wait_ready(double timeout_s) const;
  /// The same, content with coarse tiles.
  [[nodiscard]] Result<bool> wait_coarse(double timeout_s) const;

  /// Looks whether the file has a newer revision. Tiles with equal segments stay as they are, also where the
  /// poses of their submaps changed. Reads the archive's index on the caller's thread.
  /// @return true if there was one; views follow soon (LocalMapView::revision).
  /// Errors: as MapArchive::open (the map stays at its revision); InvalidArgument (made by `over`).
  [[nodiscard]] Result<bool> refresh();
  /// Goes over to this revision of the map, newer or older. Errors: ArchiveDamaged (schema).
  [[nodiscard]] Status refresh(std::shared_ptr<const MapArchive> archive);

  [[nodiscard]] LocalMemory memory() const;
  [[nodiscard]] const LocalMapSettings& settings() const;

 private:
  struct Impl;
  explicit LocalMap(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec
