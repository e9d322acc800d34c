// SPDX-License-Identifier: GPL-3.0-or-later
// A tile that was updated is several segments: coded points, and erasures of what came before them
// (FORMAT.md 11).
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

/// Which points are gone: those for which all given conditions hold, or, with `inverse`, the others.
struct Erasure {
  struct Sphere {
    Vec3 centre{0, 0, 0};  ///< [m, submap frame]
    double radius_m = 0;
    bool operator==(const Sphere&) const = default;
  };
  struct Values {
    std::string channel;         ///< one component of a stored channel
    double least = 0, most = 0;  ///< both included
    bool operator==(const Values&) const = default;
  };
  /// Rows of the rotation, then the translation [m]: conditions on place ask R p + t instead of p, so that a
  /// box of the map's frame can cut a submap that is rotated.
  std::optional<std::array<double, 12>> motion;
  std::optional<Box> box;  ///< [m, submap frame] closed
  std::optional<Sphere> sphere;
  std::optional<Values> values;
  bool inverse = false;
};

/// @param e  at least one condition. @return a payload.
[[nodiscard]] Bytes write_erasure(const Erasure& e);
/// Errors: Truncated, Malformed (not an erasure, no condition, NaN).
[[nodiscard]] Result<Erasure> read_erasure(ByteSpan payload);
/// Removes the points that `e` names. Errors: Malformed (no such channel, or of several components).
[[nodiscard]] Status erase_points(PointCloud& cloud, const Erasure& e);

/// Whether a point at `p` goes whatever its channels hold.
[[nodiscard]] bool is_erased(const Erasure& e, const Vec3& p);

/// One payload of several, in the order in which they apply; a single one stays as it is.
/// @param segments  not empty; may be joined ones.
[[nodiscard]] Bytes join_segments(std::span<const Bytes> segments);
/// The payloads that `payload` was joined from; itself where it was not. They look into it.
/// Errors: Truncated, Malformed (none, one within another).
[[nodiscard]] Result<std::vector<ByteSpan>> split_segments(ByteSpan payload);
[[nodiscard]] bool is_joined(ByteSpan payload);
[[nodiscard]] bool is_erasure(ByteSpan payload);

/// A pending segment was coded quickly and more exactly than promised: folding it is yet to come.
void mark_pending(Bytes& payload);
[[nodiscard]] bool is_pending(ByteSpan payload);

/// How one coded segment becomes points.
using SegmentDecoder = std::function<Result<PointCloud>(ByteSpan, const DecodeLimits&)>;

/// Points of a joined payload: those of its segments one after the other, without what was erased (by values
/// only where `decode` gives channels).
/// @param empty  layout of the result where nothing is left.
/// Errors: those of `decode`; Truncated, Malformed, LimitExceeded (all segments together).
[[nodiscard]] Result<PointCloud> decode_segments(ByteSpan payload, PointCloud empty,
                                                 const DecodeLimits& limits, const SegmentDecoder& decode);

}  // namespace mapcodec
