// SPDX-License-Identifier: GPL-3.0-or-later
// What a LocalMap decides: which tile to load next, which to give up, and what a view shows.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "slam_adapter/local_map.hpp"
#include "slam_adapter/local_map_plan.hpp"

namespace mapcodec {

/// One revision of a map, ready for planning.
struct MapRevision {
  std::shared_ptr<const MapArchive> archive;
  MapSchema schema;
  std::vector<Box> boxes;            ///< of the tiles [m, map frame]
  std::vector<RigidMotion> motions;  ///< T_map_submap of each submap

  [[nodiscard]] const TileRecord& record(std::size_t tile) const { return archive->tiles()[tile]; }
  [[nodiscard]] RigidMotion motion(std::uint32_t submap) const {
    return submap < motions.size() ? motions[submap] : RigidMotion();
  }
};
/// Errors: ArchiveDamaged (schema).
[[nodiscard]] Result<std::shared_ptr<const MapRevision>> read_revision(
    std::shared_ptr<const MapArchive> archive);

/// Threads: one at a time (LocalMap holds a lock).
class LocalMapBuilder {
 public:
  struct Job {
    std::shared_ptr<const MapRevision> revision;
    std::size_t tile = 0;
    std::optional<unsigned> level;
    Reservation reserved;
    std::uint64_t bytes = 0;  ///< of the reservation
  };
  using Loaded = Result<std::shared_ptr<const LocalTile>>;

  LocalMapBuilder(const LocalMapSettings& settings, std::shared_ptr<const MapRevision> revision);

  /// Tiles that are the same in this revision stay.
  void set_revision(std::shared_ptr<const MapRevision> revision);
  /// @param sequence  number of the pose, for views to bear.
  void plan(const Vec3& position, const Vec3& velocity, std::uint64_t sequence);

  /// The next tile to load, its memory reserved; nothing if there is none, or no memory for it.
  [[nodiscard]] std::optional<Job> next_job();
  /// The last call of next_job gave tiles up: call again when the new view has replaced the old one.
  [[nodiscard]] bool gave_up_tiles() const { return gave_up_; }
  /// Memory comes free as soon as somebody lets go of an old view.
  [[nodiscard]] bool waits_for_views() const { return waits_for_views_; }
  /// @param bytes  of the job's reservation.
  void finish(const MapRevision* revision, std::size_t tile, std::uint64_t bytes, Loaded loaded);

  /// A new view if something changed since the last one; else nullptr.
  [[nodiscard]] std::shared_ptr<const LocalMapView> new_view();
  [[nodiscard]] static std::uint64_t sequence_of(const LocalMapView& view) { return view.sequence_; }
  /// Tiles that were given up; to be let go of where no lock is held.
  [[nodiscard]] std::vector<std::shared_ptr<const LocalTile>> take_trash() { return std::move(trash_); }
  [[nodiscard]] const MemoryBudget& budget() const { return *budget_; }

 private:
  enum class State : std::uint8_t { absent, loading, there, failed };
  struct Slot {
    State state = State::absent;
    bool wanted = false;
    double order = 0;            ///< of a wanted tile
    std::uint64_t last_use = 0;  ///< number of the plan that had it within the keep radius
    std::shared_ptr<const LocalTile> content;
    std::optional<Error> error;
  };

  [[nodiscard]] bool has_coarse_form(std::size_t tile) const;
  [[nodiscard]] std::optional<Job> reserve(const WantedTile& w, std::optional<unsigned> level);
  [[nodiscard]] bool make_room(const WantedTile& w, std::uint64_t bytes);
  [[nodiscard]] std::optional<std::size_t> victim(const WantedTile& w) const;
  void give_up(std::size_t tile);
  void fail(std::size_t tile, Error error);
  void put(std::size_t tile, std::shared_ptr<const LocalTile> content);
  [[nodiscard]] std::uint64_t held_elsewhere() const;
  [[nodiscard]] double distance_of(std::size_t tile) const {
    return distance(revision_->boxes[tile], position_);
  }
  void count_near(LocalMapView& view) const;

  LocalMapSettings settings_;
  std::shared_ptr<MemoryBudget> budget_;
  std::shared_ptr<const MapRevision> revision_;
  std::vector<Slot> slots_;
  std::vector<std::size_t> there_, failed_;  ///< indices of slots
  std::vector<WantedTile> wanted_;
  std::vector<std::shared_ptr<const LocalTile>> trash_;
  Vec3 position_{0, 0, 0};
  std::uint64_t sequence_ = 0, plans_ = 0;
  std::uint64_t loading_ = 0, loading_bytes_ = 0, there_bytes_ = 0;
  bool changed_ = true, gave_up_ = false, starved_ = false, waits_for_views_ = false;
};

}  // namespace mapcodec
