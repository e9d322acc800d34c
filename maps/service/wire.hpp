// SPDX-License-Identifier: GPL-3.0-or-later
// Between messages and the library's own types. Messages come from anybody: what is read is checked.
#pragma once

#include <vector>

#include "maps/map_archive.hpp"
#include "maps/map_changes.hpp"
#include "maps/service/map_service.hpp"
#include "maps/service/v1/map_service.pb.h"

namespace mapcodec::wire {

/// @return coordinates as they came: float32 or float64. Errors: Malformed (bytes do not fit the count, both
/// or no coordinates, channels: type, components, name), LimitExceeded.
[[nodiscard]] Result<PointCloud> read(const v1::Points& points, std::uint64_t max_points);
/// @param f64  else float32. @param begin, end  of the points.
void write(const PointCloud& cloud, std::size_t begin, std::size_t end, bool f64, v1::Points& out);
/// Layout only. Errors: Malformed.
[[nodiscard]] Result<ChannelInfo> read(const v1::Channel& channel);
void write(const ChannelInfo& info, v1::Channel& out);

/// The quaternion is normalised; all zero is no rotation. Errors: InvalidArgument (not finite, length not 1
/// within 1e-3).
[[nodiscard]] Result<PoseChange> read(const v1::Pose& pose);
void write(const Vec3& translation_m, const std::array<double, 4>& rotation_xyzw, v1::Pose& out);
[[nodiscard]] Vec3 read(const v1::Vector& v);
void write(const Vec3& v, v1::Vector& out);
[[nodiscard]] Box read(const v1::Box& box);
void write(const Box& box, v1::Box& out);
/// Errors: Malformed (level).
[[nodiscard]] Result<TileSelection::Key> read(const v1::TileKey& key);
void write(std::uint32_t submap, const TileKey& key, v1::TileKey& out);
[[nodiscard]] TileErrors read(const v1::TileErrors& errors);
void write(const TileErrors& errors, v1::TileErrors& out);

void write(const MapArchive& archive, v1::MapFacts& out);
/// Errors: Malformed.
[[nodiscard]] Result<MapInfo> read(const v1::MapFacts& facts);
void write(const TileChange& change, v1::TileChange& out);
[[nodiscard]] std::string bytes_of(const ContentHash& hash);
/// Errors: Malformed (not 16 bytes).
[[nodiscard]] Result<ContentHash> read_hash(std::string_view bytes);

}  // namespace mapcodec::wire
