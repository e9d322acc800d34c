// SPDX-License-Identifier: GPL-3.0-or-later
// What a map archive says about a map and its tiles (FORMAT.md).
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/cloud/tile_key.hpp"
#include "mapcodec/cloud/vec3.hpp"
#include "mapcodec/codec/tile_codec.hpp"
#include "maps/content_hash.hpp"

namespace mapcodec {

inline constexpr std::uint32_t kMaxSegmentBytes = std::uint32_t{1} << 30;  ///< largest segment of a tile
inline constexpr std::uint8_t kMaxTileLevel = 30;                          ///< largest level of a placed tile
inline constexpr const char* kArchiveFormatVersion = "0.1";                ///< what MapWriter writes

/// Where a run of immutable bytes lies in a TileStore, and what they must be.
struct SegmentRef {
  std::uint64_t offset = 0;
  std::uint32_t length = 0;
  std::uint32_t crc = 0;  ///< CRC-32C of the bytes
  bool operator==(const SegmentRef&) const = default;
};

/// One tile at one revision.
struct TileRecord {
  TileKey key;
  std::uint32_t submap = 0;
  std::uint8_t codec = 0;    ///< kind of the base segment; never interpreted here
  std::uint64_t points = 0;  ///< points that the decoder will give
  Box bounds;         ///< [m] contains all points, rounded outward to 1/14 of the cube; empty if the tile is
                      ///< unplaced
  TileErrors errors;  ///< rounded up by at most 1/32 of the map's largest, never beyond it
  std::vector<SegmentRef> segments;  ///< the base, then deltas in the order in which they apply
  std::vector<ContentHash> hashes;   ///< of the segments; empty where the archive does not store them
};

/// Tiles are stored submap by submap, each in Morton order.
[[nodiscard]] inline std::strong_ordering compare_tiles(std::uint32_t submap_a, const TileKey& a,
                                                        std::uint32_t submap_b, const TileKey& b) {
  return submap_a != submap_b ? submap_a <=> submap_b : compare_morton(a, b);
}

/// A rigid piece of the map with its own frame.
struct Submap {
  std::string name;
  Vec3 translation_m{0, 0, 0};                      ///< T_map_submap
  std::array<double, 4> rotation_xyzw{0, 0, 0, 1};  ///< unit quaternion of T_map_submap
  double first_stamp_s = 0, last_stamp_s = 0;       ///< of its scans [s since epoch]
  bool operator==(const Submap&) const = default;
};

/// A named revision that compaction keeps.
struct Snapshot {
  std::string name;
  std::uint64_t revision = 0;
  bool operator==(const Snapshot&) const = default;
};

/// Facts about the whole map at one revision.
struct MapInfo {
  Bytes schema;                      ///< opaque; handed back as given
  Vec3 origin{0, 0, 0};              ///< [m, map frame] corner of tile (0, 0, 0); never changes
  double tile_size_m = 1;            ///< side of a level-0 tile; never changes
  std::uint64_t input_points = 0;    ///< points that went in
  std::uint64_t input_bytes = 0;     ///< bytes of the inputs
  std::uint64_t dropped_points = 0;  ///< points that were not kept (not finite)
  TileErrors achieved;      ///< of the whole map; max_axis_error_m exact, the others rounded up to float32
  Box bounds;               ///< [m] of all points, rounded outward by less than tile_size_m / 2^20
  std::uint64_t flags = 0;  ///< meaning belongs to the caller
  std::vector<Submap> submaps;  ///< empty: one, unnamed, at identity
  std::vector<Snapshot> snapshots;
  std::map<std::string, Bytes> extras;  ///< for what later programs add; unknown names are kept
};

/// One commit, as `log` lists it.
struct RevisionInfo {
  std::uint64_t revision = 0;
  std::int64_t timestamp_s = 0;  ///< [s since epoch] as the writer gave it
  std::uint64_t tiles = 0;
  std::uint64_t offset = 0;  ///< of the commit record
  std::uint64_t bytes = 0;   ///< of the commit: segments, index, metadata, record
};

}  // namespace mapcodec
