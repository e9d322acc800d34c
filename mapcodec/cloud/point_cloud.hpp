// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "mapcodec/cloud/channel.hpp"
#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// How the source wrote its coordinates: what "every bit" means for them, and how a writer should write them.
struct CoordinateFormat {
  enum class Kind : std::uint8_t { f32 = 1, f64 = 2, fixed = 3 };
  Kind kind = Kind::f32;
  Vec3 scale{1, 1, 1};   ///< fixed only: x = integer * scale + offset, integers of 32 bits (LAS)
  Vec3 offset{0, 0, 0};  ///< fixed only
  bool operator==(const CoordinateFormat&) const = default;

  /// Bytes of one xyz in the source (12 or 24).
  [[nodiscard]] std::size_t stride() const { return kind == Kind::f64 ? 24 : 12; }
};

/// N points [m, map frame] with their channels, each of N values.
struct PointCloud {
  CoordinateFormat coordinates;
  std::vector<Vec3> xyz;
  std::vector<Channel> channels;

  [[nodiscard]] std::size_t size() const { return xyz.size(); }
  [[nodiscard]] bool empty() const { return xyz.empty(); }

  /// The channel called `name`, or nullptr.
  [[nodiscard]] const Channel* find(std::string_view name) const;
  [[nodiscard]] Channel* find(std::string_view name);

  /// Same format and channels, no point.
  [[nodiscard]] PointCloud like() const;
  /// Makes all arrays `count` long.
  void resize(std::size_t count);
  /// Appends points [begin, end) of `other`, which has the same channels in the same order.
  void append(const PointCloud& other, std::size_t begin, std::size_t end);
  void append(const PointCloud& other) { append(other, 0, other.size()); }
  /// The points at `order`, in that order (an index may stand twice).
  [[nodiscard]] PointCloud gather(const std::vector<std::uint32_t>& order) const;
  /// Bounds of the finite points; empty if there is none.
  [[nodiscard]] Box bounds() const;
};

}  // namespace mapcodec
