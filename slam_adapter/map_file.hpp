// SPDX-License-Identifier: GPL-3.0-or-later
// A map file as its users see it: what it holds, and its points, whole or a region at a time.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/codec/tile_levels.hpp"
#include "mapcodec/codec/tile_patches.hpp"
#include "maps/map_archive.hpp"
#include "parallel/progress.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/level_errors.hpp"

namespace mapcodec {

/// A part of space [m, map frame]: everything, a box, or a ball.
struct Region {
  std::optional<Box> box;
  struct Sphere {
    Vec3 centre{0, 0, 0};
    double radius_m = 0;
  };
  std::optional<Sphere> sphere;

  [[nodiscard]] bool everything() const { return !box && !sphere; }
  [[nodiscard]] bool contains(const Vec3& p) const;
  /// True if every point of the box lies in the region.
  [[nodiscard]] bool contains(const Box& b) const;
  /// A box around the region (infinite for everything).
  [[nodiscard]] Box bounds() const;
};

/// Totals of a map, for `info`.
struct MapSummary {
  struct CodecTotals {
    std::uint64_t tiles = 0, points = 0, bytes = 0;
  };
  std::uint64_t points = 0, tiles = 0, bytes = 0, input_bytes = 0, raw_bytes = 0;
  double bits_per_point = 0;  ///< archive bits per input point
  double ratio = 0;           ///< archive bytes to raw bytes (12 per xyz plus the kept channels)
  TileErrors achieved;
  Box bounds;
  std::map<std::string, CodecTotals> codecs;
  LevelErrors levels;  ///< as measured when the map was compressed; none if it does not say
};

struct ReadSettings {
  Arena* arena = nullptr;  ///< nullptr: the caller's thread alone
  DecodeLimits limits;
  ProgressCallback progress;
  const std::atomic<bool>* stop = nullptr;
  /// Detail: cells of tile_size_m / 2^level a side (decode_tile_coarsely); points then have no channels.
  std::optional<unsigned> level;
};

/// An opened map at one revision. Const methods may be called from many threads.
class MapFile {
 public:
  /// Errors: NotFound, Unreadable, Empty, Malformed (no archive), Unsupported, ArchiveDamaged.
  [[nodiscard]] static Result<MapFile> open(const std::string& path,
                                            std::optional<std::uint64_t> revision = std::nullopt);

  [[nodiscard]] const MapSchema& schema() const { return schema_; }
  [[nodiscard]] const MapArchive& archive() const { return *archive_; }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] MapSummary summary() const;

  /// Indices into archive().tiles() of the tiles that meet `region`, in Morton order.
  [[nodiscard]] std::vector<std::size_t> tiles_in(const Region& region) const;
  /// Number of points in `region`: only tiles on its border are decoded.
  [[nodiscard]] Result<std::uint64_t> count(const Region& region, const ReadSettings& settings = {}) const;
  /// Hands the points of `region` to `sink`, tile by tile in Morton order; memory is bounded by the tiles in
  /// flight.
  [[nodiscard]] Status read(const Region& region, const ReadSettings& settings,
                            const std::function<Status(PointCloud&&)>& sink) const;
  /// The points of `region`, together.
  [[nodiscard]] Result<PointCloud> read(const Region& region = {}, const ReadSettings& settings = {}) const;
  /// Hands the surfaces of the tiles that meet `region` to `sink`, tile by tile in Morton order, those whose
  /// centres lie in it; for point-to-plane registration, planes and meshes. `settings.level` is ignored.
  /// @param sink  gets the tile's index and its patches; of tiles whose codec keeps no surface, too.
  [[nodiscard]] Status read_patches(const Region& region, const ReadSettings& settings,
                                    const std::function<Status(std::size_t, TilePatches&&)>& sink) const;
  /// Whether any tile has surfaces (codecs surface, paper), or levels of detail (surface, points).
  [[nodiscard]] bool has_surfaces() const;
  [[nodiscard]] bool has_levels() const;
  /// No point; the channels that read() gives.
  [[nodiscard]] PointCloud layout(const ReadSettings& settings) const;
  /// Decodes one tile, its points in the frame of its submap.
  [[nodiscard]] Result<PointCloud> read_tile_in_submap(std::size_t index,
                                                       const DecodeLimits& limits = {}) const;
  /// Decodes one tile, its points in the map's frame.
  [[nodiscard]] Result<PointCloud> read_tile(std::size_t index, const DecodeLimits& limits = {}) const;

 private:
  MapFile(std::string path, std::unique_ptr<MapArchive> archive, MapSchema schema)
      : path_(std::move(path)), archive_(std::move(archive)), schema_(std::move(schema)) {}
  [[nodiscard]] Result<Bytes> fetch(std::size_t index) const;

  std::string path_;
  std::unique_ptr<MapArchive> archive_;
  MapSchema schema_;
};

/// Whether the file at `path` begins as a map archive does (a damaged one too).
[[nodiscard]] bool is_map_file(const std::string& path);

/// Name of the channel that keeps the order of points (`CompressOptions::keep_order`).
inline constexpr const char* kOrderChannel = "point_index";
/// Sorts by the order channel and takes the channel away; a cloud without it stays as it is.
[[nodiscard]] PointCloud restore_order(PointCloud cloud);

}  // namespace mapcodec
