// SPDX-License-Identifier: GPL-3.0-or-later
// What all tiles of a map have in common, so that no tile repeats it: the second argument of every tile
// decoder.
#pragma once

#include <optional>
#include <vector>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/channel.hpp"
#include "mapcodec/cloud/occupancy_tree.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// What a map promises about its geometry (the ids are written to archives).
enum class PromiseKind : std::uint8_t { rms = 1, max_error = 2, lossless = 3, paper = 4 };
[[nodiscard]] constexpr const char* promise_name(PromiseKind k) {
  constexpr const char* kNames[] = {"?", "rms", "max_error", "lossless", "paper"};
  return kNames[static_cast<std::size_t>(k) <= 4 ? static_cast<std::size_t>(k) : 0];
}

/// How a channel is kept (the ids are written to archives).
enum class ChannelKept : std::uint8_t {
  exact = 1,     ///< every bit
  bounded = 2,   ///< within `bound`: colour as mean RGB distance (0..255), a scalar as largest absolute error
  constant = 3,  ///< all points have `constant`; nothing is stored per tile
  dropped = 4,   ///< not kept: named so that `info` can say so
};
[[nodiscard]] constexpr const char* kept_name(ChannelKept k) {
  constexpr const char* kNames[] = {"?", "exact", "bounded", "constant", "dropped"};
  return kNames[static_cast<std::size_t>(k) <= 4 ? static_cast<std::size_t>(k) : 0];
}

struct ChannelSchema {
  ChannelInfo info;
  ChannelKept kept = ChannelKept::exact;
  double bound = 0;  ///< bounded only
  Bytes constant;    ///< constant only: one value, info.stride() bytes
  bool operator==(const ChannelSchema&) const = default;
};

struct MapSchema {
  PromiseKind promise = PromiseKind::max_error;
  double promise_value = 0;  ///< metres; 0 for lossless
  Vec3 origin{0, 0, 0};      ///< [m, map frame] corner of tile (0,0,0) and of the voxel lattice
  double tile_size_m = 1;    ///< side of a level-0 tile
  double step_m = 0;         ///< voxel side of `points` tiles; 0 where there is none
  CoordinateFormat coordinates;
  std::vector<ChannelSchema> channels;  ///< in the order of the source, dropped ones too
  /// A map of occupancy tiles: what their leaves hold. A level-0 tile is then a voxel (`occupancy_schema`).
  std::optional<OccupancyKind> occupancy;

  /// Layout of a decoded cloud: all channels but the dropped ones.
  [[nodiscard]] PointCloud layout() const;
  bool operator==(const MapSchema&) const = default;
};

/// FORMAT.md 2. The archive stores these bytes once and never looks inside.
[[nodiscard]] Bytes write_schema(const MapSchema& schema);
/// Errors: Truncated, Malformed (unknown id, non-finite or non-positive size), LimitExceeded.
[[nodiscard]] Result<MapSchema> read_schema(ByteSpan bytes, const DecodeLimits& limits = {});

}  // namespace mapcodec
