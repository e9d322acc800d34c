// SPDX-License-Identifier: GPL-3.0-or-later
// A map that takes in points while it is in use: the writer's side of a living archive.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/codec/tile_segments.hpp"
#include "maps/map_writer.hpp"
#include "parallel/arena.hpp"

namespace mapcodec {

/// Key in MapInfo::extras of maps that were updated with the density cap; one byte, the rule's version: 1.
inline constexpr const char* kDensityCapExtra = "density_cap";

struct UpdateSettings {
  /// What lies on stored surfaces within the promise, at the density already reached, adds nothing.
  bool density_cap = true;
  Effort effort = Effort::fast;  ///< of pending segments
  /// What begins a tile is coded once, with the whole promise, instead of quickly and pending: for points to
  /// which nothing will be added, as those of a keyframe.
  bool for_good = false;
  std::size_t fold_after = 24;  ///< pending segments of a tile at which the next commit folds it; 0: never
  /// A tile of more points becomes up to eight smaller ones, where the map has smaller ones and no point
  /// would be coded with loss more than twice.
  std::uint64_t split_points = std::uint64_t{1} << 20;
  std::uint64_t cache_bytes = std::uint64_t{512} << 20;  ///< for what is known of tiles between insertions
  std::uint64_t batch_points = std::uint64_t{1} << 21;   ///< are coded together; more are held at no time
  const std::atomic<bool>* stop = nullptr;
};

struct UpdateReport {
  std::uint64_t revision = 0;   ///< the map's, after it
  bool committed = false;       ///< false: nothing was new, so the archive is as it was
  std::uint64_t points_in = 0;  ///< finite ones
  std::uint64_t points_added = 0;
  std::uint64_t points_known = 0;    ///< that stored ones stand for
  std::uint64_t dropped_points = 0;  ///< not finite
  std::uint64_t tiles_touched = 0, tiles_new = 0, tiles_folded = 0, tiles_removed = 0, tiles_split = 0;
  std::uint64_t bytes = 0;  ///< of new segments
};

/// What failed half way is never committed: after an error of flush, erase or fold every further call returns
/// it. One writer of one archive. Insertions are held, coded in batches, and count after `commit`;
/// destruction without it leaves the archive at its last revision. Threads: one at a time; the work uses the
/// arena's.
class MapUpdater {
 public:
  /// @param arena  must outlive the updater.
  /// Errors: those of MapWriter::open (another writer, read-only, damaged, newer format); Unsupported
  /// (`--paper` maps).
  [[nodiscard]] static Result<MapUpdater> open(const std::string& path, Arena& arena,
                                               const UpdateSettings& settings = {});
  /// Goes on with a writer that is open, as of an archive just begun. Errors: Malformed (schema),
  /// Unsupported.
  /// @param changed  the writer has changes already that its next revision shall hold.
  [[nodiscard]] static Result<MapUpdater> over(MapWriter writer, Arena& arena,
                                               const UpdateSettings& settings = {}, bool changed = false);
  MapUpdater(MapUpdater&&) noexcept;
  MapUpdater& operator=(MapUpdater&&) noexcept;
  ~MapUpdater();

  [[nodiscard]] const MapSchema& schema() const;
  [[nodiscard]] const MapInfo& info() const;
  [[nodiscard]] std::uint64_t revision() const;

  /// Number of the submap called `name`, made if there is none. A pose, if given, is set.
  /// Errors: InvalidArgument (name empty or longer than 255 bytes; pose), Unsupported (as set_poses).
  [[nodiscard]] Result<std::uint32_t> submap(const std::string& name, const std::optional<PoseChange>& pose);
  /// Errors: InvalidArgument, as MapWriter::set_poses; Unsupported (an octree would be moved). No tile is
  /// touched.
  [[nodiscard]] Status set_poses(std::span<const PoseChange> poses);

  /// When the scans of a submap were taken [s since epoch]. Errors: InvalidArgument (no such submap).
  [[nodiscard]] Status set_stamps(std::uint32_t submap, double first_s, double last_s);

  enum class ScanEnd { here, later };
  /// @param end  `later`: more points of the same scan come next. Scans are held against those before them,
  /// as if each had been committed alone; points of one scan are not held against each other.
  /// @param points  [m, submap frame]; channels in any order. What the map does not keep is left out; what it
  /// keeps must be there. Points that are not finite are dropped and counted (lossless maps: kept).
  /// Errors: Malformed (a kept channel is missing or of another type, another constant), InvalidArgument
  /// (coordinates that a lossless map cannot hold), Unsupported (a map of an octree alone, or the submap that
  /// holds one), those of `flush`.
  [[nodiscard]] Status insert(PointCloud points, std::uint32_t submap = 0, ScanEnd end = ScanEnd::here);
  /// Erases points of one submap, or of all (then `e` is in the map's frame, and a box needs submaps that are
  /// not rotated; nothing: all points). Tiles that are left empty go away.
  /// Errors: InvalidArgument (a channel that the map does not keep, a rotated box), Unsupported (a map of an
  /// octree alone), those of `flush`.
  [[nodiscard]] Status erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap);
  /// Folds the pending segments of tiles that have at least `least` (1: all).
  [[nodiscard]] Status fold(std::size_t least = 1);
  /// What was inserted to be continued is complete.
  void end_scan();
  /// For the record: size of what was inserted.
  void add_input_bytes(std::uint64_t bytes);
  /// A fact of the next revision (MapInfo::extras). @param alone  makes one even if nothing else changed.
  void set_extra(const std::string& name, Bytes value, bool alone = false);
  /// Codes what was inserted. Called as needed.
  [[nodiscard]] Status flush();

  /// Makes all changes since the last commit one revision. @param timestamp_s  [s since epoch].
  /// Errors: those of `flush` and MapWriter::commit.
  [[nodiscard]] Result<UpdateReport> commit(std::int64_t timestamp_s);

 private:
  struct State;
  explicit MapUpdater(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace mapcodec
