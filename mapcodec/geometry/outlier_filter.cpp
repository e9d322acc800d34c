// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/outlier_filter.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

/// Points sorted into cubes of side radius / sqrt(3): those of one cube are neighbours without a look at
/// distances.
class CubeGrid {
 public:
  CubeGrid(std::span<const Vec3> xyz, std::span<const std::uint32_t> subset, double radius_m)
      : xyz_(xyz), subset_(subset), radius_(radius_m), side_(radius_m / 1.7320508075688774) {
    entries_.reserve(subset.size());
    for (std::uint32_t i = 0; i < subset.size(); ++i) entries_.push_back({key(cube_of(subset[i])), i});
    std::sort(entries_.begin(), entries_.end());
  }

  std::vector<bool> supported(std::uint32_t neighbors) const {
    std::vector<bool> r(subset_.size());
    for (std::size_t begin = 0; begin < entries_.size();) {
      const std::size_t end = end_of(begin);
      for (std::size_t e = begin; e < end; ++e) {
        const std::uint32_t i = entries_[e].second;
        r[i] = end - begin > neighbors || count(subset_[i], neighbors + 1) > neighbors;
      }
      begin = end;
    }
    return r;
  }

 private:
  using Cube = std::array<std::int64_t, 3>;
  using Entry = std::pair<std::uint64_t, std::uint32_t>;

  [[nodiscard]] Cube cube_of(std::uint32_t i) const {
    Cube c;
    for (std::size_t d = 0; d < 3; ++d) c[d] = static_cast<std::int64_t>(std::floor(xyz_[i][d] / side_));
    return c;
  }
  static std::uint64_t key(const Cube& c) {
    std::uint64_t k = 0;
    for (const std::int64_t v : c) k = k << 21 | (static_cast<std::uint64_t>(v + (1 << 20)) & 0x1fffff);
    return k;
  }
  [[nodiscard]] std::size_t end_of(std::size_t begin) const {
    std::size_t end = begin;
    while (end < entries_.size() && entries_[end].first == entries_[begin].first) ++end;
    return end;
  }

  /// Points within the radius of point i, itself too; stops at `enough`.
  [[nodiscard]] std::uint32_t count(std::uint32_t i, std::uint32_t enough) const {
    const Cube at = cube_of(i);
    std::uint32_t found = 0;
    for (std::int64_t x = -2; x <= 2; ++x) {
      for (std::int64_t y = -2; y <= 2; ++y) {
        // The five cubes along z have keys that follow each other.
        const std::uint64_t low = key({at[0] + x, at[1] + y, at[2] - 2});
        for (auto e = std::lower_bound(entries_.begin(), entries_.end(), Entry{low, 0});
             e != entries_.end() && e->first <= low + 4; ++e) {
          found += near(xyz_[i], xyz_[subset_[e->second]]);
          if (found >= enough) return found;
        }
      }
    }
    return found;
  }
  [[nodiscard]] bool near(const Vec3& a, const Vec3& b) const {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z <= radius_ * radius_;
  }

  std::span<const Vec3> xyz_;
  std::span<const std::uint32_t> subset_;
  double radius_, side_;
  std::vector<Entry> entries_;  ///< cube, index into subset_
};

}  // namespace

std::vector<bool> find_supported_points(std::span<const Vec3> xyz, std::span<const std::uint32_t> subset,
                                        std::uint32_t neighbors, double radius_m) {
  if (neighbors == 0 || !(radius_m > 0)) return std::vector<bool>(subset.size(), true);
  return CubeGrid(xyz, subset, radius_m).supported(neighbors);
}

}  // namespace mapcodec
