// SPDX-License-Identifier: GPL-3.0-or-later
// Octrees in an archive: whole, a box at a time, and updated tile by tile.
#pragma once

#include "mapcodec/cloud/occupancy_pieces.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/map_updater.hpp"
#include "slam_adapter/octomap/octree_file.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"

namespace mapcodec {

/// Name of the extra (maps/FORMAT.md) that keeps inner nodes above all tiles which differ from what their
/// children make of them.
inline constexpr const char* kOctreeNodesExtra = "octree_nodes";
[[nodiscard]] Bytes write_octree_nodes(const std::vector<OccupancyExtra>& nodes);
/// Errors: Truncated, Malformed.
[[nodiscard]] Result<std::vector<OccupancyExtra>> read_octree_nodes(ByteSpan bytes);

struct OccupancyWrite {
  Arena* arena = nullptr;        ///< nullptr: the caller's thread alone
  std::uint64_t most_nodes = 0;  ///< inner nodes of a tile; 0: kOccupancyTileNodes
  std::uint64_t input_bytes = 0;
  bool overwrite = false;
  std::int64_t timestamp_s = 0;
  ProgressCallback progress;
  const std::atomic<bool>* stop = nullptr;
};

/// A new archive of one tree. The same bytes for any number of threads.
/// Errors: Empty, CannotWrite, Cancelled.
[[nodiscard]] Status create_occupancy_map(const std::string& path, const OccupancyTree& tree,
                                          double resolution_m, const OccupancyWrite& settings);

/// The octree of an opened archive, at one revision. Const methods may be called from many threads.
class OccupancyMap {
 public:
  /// Errors: those of MapFile::open; Unsupported (the archive holds no octree, or one that was
  /// moved by a pose).
  [[nodiscard]] static Result<OccupancyMap> open(const std::string& path,
                                                 std::optional<std::uint64_t> revision = std::nullopt);

  [[nodiscard]] OccupancyKind kind() const { return kind_; }
  [[nodiscard]] double resolution_m() const { return resolution_m_; }
  [[nodiscard]] const MapFile& file() const { return file_; }

  /// The leaves whose cubes meet `region`, whole ones, as a tree of height 16; only tiles that meet it are
  /// read. Inner nodes of a part are what their children make of them. An empty tree if nothing is known
  /// there.
  [[nodiscard]] Result<OccupancyTree> read(const Region& region = {},
                                           const ReadSettings& settings = {}) const;
  /// Tiles that meet the region.
  [[nodiscard]] std::vector<std::size_t> tiles_in(const Region& region) const;

 private:
  OccupancyMap(MapFile file, OccupancyKind kind, double resolution_m, std::optional<std::uint32_t> submap)
      : file_(std::move(file)), kind_(kind), resolution_m_(resolution_m), submap_(submap) {}

  MapFile file_;
  OccupancyKind kind_;
  double resolution_m_;
  std::optional<std::uint32_t> submap_;  ///< of an archive of points, the one that holds the octree
};

/// Replaces what the map says of the space that `tree` knows: its leaves count, where it knows nothing the
/// map stays. Tiles in which nothing changes keep their bytes; one revision, or none if nothing changes.
/// An archive of points gets a submap "octree" of its own for it, once.
/// @param tree  of the map's kind and resolution (a binary map takes the cells of any).
/// @param changed  only these voxels (OctoMap's keys, as its change detection names them); nullptr: all of
/// the tree.
/// Errors: those of MapWriter; InvalidArgument (resolution or kind; the archive's grid of tiles does not
/// fit); Unsupported (the map's octree was moved by a pose).
[[nodiscard]] Result<UpdateReport> update_occupancy_map(const std::string& path, const OccupancyTree& tree,
                                                        double resolution_m, const OccupancyWrite& settings,
                                                        const std::vector<CellCorner>* changed = nullptr);

/// The same as part of the writer's next revision, which is left to the caller. The report's `committed` says
/// whether there is anything to commit.
[[nodiscard]] Result<UpdateReport> lay_octree(MapWriter& writer, const OccupancyTree& tree,
                                              double resolution_m, const OccupancyWrite& settings,
                                              const std::vector<CellCorner>* changed = nullptr);

/// Whether the archive's tree equals `tree`: leaves, log-odds, colours, inner nodes.
/// @return what differs first, in a sentence; empty if nothing. Errors: as OccupancyMap.
[[nodiscard]] Result<std::string> compare_occupancy_map(const std::string& path, const OctreeFile& original,
                                                        const ReadSettings& settings);

}  // namespace mapcodec
