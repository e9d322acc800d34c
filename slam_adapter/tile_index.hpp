// SPDX-License-Identifier: GPL-3.0-or-later
// Nearest neighbours among the points of one tile.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// x, y, z [m] from a tile's origin.
using Point3f = std::array<float, 3>;

/// The nearest points that several indices have found so far, the nearest first.
class NearestHits {
 public:
  struct Hit {
    std::uint32_t tile = 0, point = 0;
    double squared_m2 = 0;
  };

  /// @param most     0: as many as lie within the radius, then in no order until `sort`.
  /// @param radius_m  may be infinite, unless `most` is 0.
  NearestHits(std::size_t most, double radius_m) : most_(most), bound_(radius_m * radius_m) {
    hits_.reserve(std::min<std::size_t>(most, 1024));
  }
  /// The tile that further hits belong to.
  void set_tile(std::uint32_t tile) { tile_ = tile; }
  void add(double squared, std::uint32_t point);
  /// Farther points than this are of no use [m^2].
  [[nodiscard]] double worst() const {
    return most_ == 0 || hits_.size() < most_ ? bound_ : hits_.back().squared_m2;
  }
  void sort();
  [[nodiscard]] const std::vector<Hit>& hits() const { return hits_; }

 private:
  std::size_t most_;
  double bound_;
  std::uint32_t tile_ = 0;
  std::vector<Hit> hits_;
};

/// A k-d tree (nanoflann) over points that stay where they are. Threads: const methods from many at once.
class TileIndex {
 public:
  /// Reserve for an index per point [bytes]; real tiles take about half of it.
  static constexpr std::uint64_t kBytesPerPoint = 28;

  TileIndex();
  /// @param points  finite, fewer than 2^32; must outlive the index and not move. May be empty.
  explicit TileIndex(std::span<const Point3f> points);
  ~TileIndex();
  TileIndex(TileIndex&&) noexcept;
  TileIndex& operator=(TileIndex&&) noexcept;

  /// Adds the points nearest to `query` [m from the tile's origin].
  void nearest(const Vec3& query, NearestHits& hits) const;
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec
