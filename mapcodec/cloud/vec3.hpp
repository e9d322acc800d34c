// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace mapcodec {

/// x, y, z [m] in double: UTM coordinates (1e6 m) keep their millimetres.
using Vec3 = std::array<double, 3>;

[[nodiscard]] inline bool is_finite(const Vec3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Axis-aligned box, closed on all sides. Empty (min > max) until something is added.
struct Box {
  Vec3 min{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
           std::numeric_limits<double>::infinity()};
  Vec3 max{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
           -std::numeric_limits<double>::infinity()};

  [[nodiscard]] bool empty() const { return !(min[0] <= max[0]); }
  void add(const Vec3& p) {
    for (std::size_t d = 0; d < 3; ++d) {
      min[d] = std::min(min[d], p[d]);
      max[d] = std::max(max[d], p[d]);
    }
  }
  void add(const Box& b) {
    if (b.empty()) return;
    add(b.min);
    add(b.max);
  }
  [[nodiscard]] bool contains(const Vec3& p) const {
    return p[0] >= min[0] && p[0] <= max[0] && p[1] >= min[1] && p[1] <= max[1] && p[2] >= min[2] &&
           p[2] <= max[2];
  }
  [[nodiscard]] bool intersects(const Box& b) const {
    for (std::size_t d = 0; d < 3; ++d) {
      if (b.max[d] < min[d] || b.min[d] > max[d]) return false;
    }
    return !empty() && !b.empty();
  }
};

}  // namespace mapcodec
