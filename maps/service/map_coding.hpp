// SPDX-License-Identifier: GPL-3.0-or-later
// What the service needs of those who look inside tiles: it stores maps, others code them.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/codec/tile_segments.hpp"
#include "maps/map_types.hpp"
#include "maps/submap_pose.hpp"

namespace mapcodec {

/// What a map is begun with; it never changes afterwards.
struct NewMap {
  PromiseKind promise = PromiseKind::rms;  ///< not `paper`
  double promise_m = 0.01;                 ///< 0 for lossless
  double color_error = 10;                 ///< mean RGB distance, 0 .. 255; 0: exact
  double tile_size_m = 0;                  ///< 0: from the sample, else 10 m
  std::vector<ChannelInfo> channels;       ///< to keep
  PointCloud sample;  ///< points like those that will come [m, map frame], to choose by; may be empty
};

/// What one commit did.
struct EditReport {
  std::uint64_t revision = 0;
  bool committed = false;  ///< false: nothing was new
  std::uint64_t points_in = 0, points_added = 0, tiles_touched = 0;
};

/// The one writer of one archive. What failed half way is never committed; after an error of `commit` this
/// object is of no more use. Threads: one at a time.
class MapEditor {
 public:
  virtual ~MapEditor() = default;
  [[nodiscard]] virtual const MapSchema& schema() const = 0;
  [[nodiscard]] virtual const MapInfo& info() const = 0;
  /// Number of the submap called `name`, made if there is none; its pose is set if given.
  [[nodiscard]] virtual Result<std::uint32_t> submap(const std::string& name,
                                                     const std::optional<PoseChange>& pose) = 0;
  [[nodiscard]] virtual Status set_poses(std::span<const PoseChange> poses) = 0;
  /// @param points  [m, submap frame]
  [[nodiscard]] virtual Status insert(PointCloud points, std::uint32_t submap) = 0;
  /// Points of a submap, or of all (then `e` is in the map's frame); nothing: all of them.
  [[nodiscard]] virtual Status erase(const std::optional<Erasure>& e,
                                     std::optional<std::uint32_t> submap) = 0;
  /// Codes for good what was coded quickly. Takes long; see MapCoding::edit.
  [[nodiscard]] virtual Status fold() = 0;
  /// A fact that is stored with the next commit that stores anything else.
  virtual void set_extra(const std::string& name, Bytes value) = 0;
  [[nodiscard]] virtual Result<EditReport> commit(std::int64_t timestamp_s) = 0;
};

/// Threads: from many at once.
class MapCoding {
 public:
  virtual ~MapCoding() = default;
  /// Begins an archive at `path` and commits it empty. Errors: InvalidArgument, Unsupported, CannotWrite.
  [[nodiscard]] virtual Status create(const std::string& path, const NewMap& map) = 0;
  /// @param stop  becomes true: `fold` and `commit` end with Cancelled. nullptr: never.
  /// Errors: as MapWriter::open; Unsupported.
  [[nodiscard]] virtual Result<std::unique_ptr<MapEditor>> edit(const std::string& path,
                                                                const std::atomic<bool>* stop) = 0;
  /// Whether points can go into a map with this schema, without looking at the archive.
  /// Errors: Malformed (a kept channel is missing or of another type).
  [[nodiscard]] virtual Status check(const PointCloud& points, const MapSchema& schema) const = 0;
  /// Points of a tile [m, submap frame]. @param level  less detail (decode_tile_coarsely).
  [[nodiscard]] virtual Result<PointCloud> decode(const std::vector<ByteSpan>& segments,
                                                  const MapSchema& schema, std::optional<unsigned> level,
                                                  const DecodeLimits& limits) const = 0;
  /// The first bytes of a base that `decode` needs for this level of detail; all of them where it has no
  /// levels.
  [[nodiscard]] virtual Result<std::uint64_t> bytes_of_level(ByteSpan base, const MapSchema& schema,
                                                             unsigned level) const = 0;
};

}  // namespace mapcodec
