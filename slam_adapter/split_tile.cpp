// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/split_tile.hpp"

#include <algorithm>
#include <map>

namespace mapcodec {
namespace {

/// The part of `key` that a point lies in. Points that rounding put outside the tile go to the nearest part.
TileKey part_of(const TileKey& key, const Vec3& p, const MapSchema& schema) {
  const double side = std::ldexp(schema.tile_size_m, key.level - 1);
  std::array<std::int32_t, 3> at{key.x, key.y, key.z};
  for (std::size_t d = 0; d < 3; ++d) {
    const double middle = schema.origin[d] + (2.0 * at[d] + 1) * side;
    at[d] = 2 * at[d] + (p[d] >= middle ? 1 : 0);
  }
  return {at[0], at[1], at[2], static_cast<std::uint8_t>(key.level - 1)};
}

bool has_lasting(const std::vector<ByteSpan>& segments) {
  return !std::all_of(segments.begin(), segments.end(),
                      [](ByteSpan s) { return is_pending(s) || is_erasure(s); });
}

Result<Fold> encode_part(PointCloud points, const MapSchema& schema, const PendingCoding& coding,
                         const TileErrors& errors, bool as_pending) {
  const bool exact = is_exact_again(schema);
  MAPCODEC_ASSIGN(EncodedTile t, as_pending ? encode_pending(std::move(points), schema, coding)
                                            : encode_for_good(std::move(points), schema, !exact, {}));
  Fold f;
  f.codec = t.bytes[0];
  f.points = t.points;
  f.bounds = t.bounds;
  f.errors = exact || as_pending ? errors : joint_errors(errors, t.errors, 1);
  f.bytes = std::move(t.bytes);
  if (!exact && !as_pending) {
    f.coded_points = t.points;
    f.forward_m = t.rms_forward_m;
    f.backward_m = t.rms_backward_m;
  }
  return f;
}

}  // namespace

Result<std::optional<std::vector<TilePart>>> split_tile(const TileKey& key,
                                                        const std::vector<Bytes>& segments,
                                                        const MapSchema& schema, const PendingCoding& coding,
                                                        const TileErrors& errors) {
  using Parts = std::vector<TilePart>;
  if (key.is_unplaced() || key.level == 0) return std::optional<Parts>{};
  const Bytes joined = join_segments(segments);
  MAPCODEC_ASSIGN(const std::vector<ByteSpan> all, split_segments(joined));
  if (!is_exact_again(schema) && has_lasting(all)) return std::optional<Parts>{};
  MAPCODEC_ASSIGN(const PointCloud points, decode_tile(joined, schema));
  std::map<TileKey, std::vector<std::uint32_t>, MortonLess> members;
  for (std::uint32_t i = 0; i < points.size(); ++i) members[part_of(key, points.xyz[i], schema)].push_back(i);
  const bool as_pending = !is_exact_again(schema) && !has_bounded_color(schema);
  Parts parts;
  for (const auto& [part, indices] : members) {
    MAPCODEC_ASSIGN(Fold tile, encode_part(points.gather(indices), schema, coding, errors, as_pending));
    parts.push_back({part, std::move(tile)});
  }
  return std::optional<Parts>{std::move(parts)};
}

}  // namespace mapcodec
