// SPDX-License-Identifier: GPL-3.0-or-later
// One number for a set of points in any order: do two clouds hold the same points, bit by bit?
#pragma once

#include <cstdint>
#include <string>

#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// Sum mod 2^128 of a 128-bit hash of each point: its coordinates as `coordinates` stores them and all its
/// channels (by name, whatever their order). Clouds with the same points in any order, in any blocks, have
/// the same sum; a point that stands twice counts twice. It guards against mistakes, not against forgery.
class MultisetHash {
 public:
  /// Adds all points of `block`. Threads: one at a time; sums of parts made by several threads can be merged.
  void add(const PointCloud& block);
  void merge(const MultisetHash& other);

  [[nodiscard]] std::uint64_t points() const { return points_; }
  /// 32 hexadecimal digits.
  [[nodiscard]] std::string hex() const;
  bool operator==(const MultisetHash&) const = default;

 private:
  void add_sum(std::uint64_t low, std::uint64_t high);

  std::uint64_t low_ = 0, high_ = 0, points_ = 0;
};

[[nodiscard]] MultisetHash multiset_hash(const PointCloud& cloud);

}  // namespace mapcodec
