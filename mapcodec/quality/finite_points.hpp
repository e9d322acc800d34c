// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <optional>

#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// A cloud without its non-finite points; a copy only where there are some. The cloud must outlive it.
class FinitePoints {
 public:
  explicit FinitePoints(const PointCloud& cloud) : all_(cloud) {
    if (!std::all_of(cloud.xyz.begin(), cloud.xyz.end(), is_finite)) some_ = finite_part(cloud);
  }
  [[nodiscard]] const PointCloud& operator*() const { return some_ ? *some_ : all_; }
  [[nodiscard]] const PointCloud* operator->() const { return &**this; }

 private:
  static PointCloud finite_part(const PointCloud& cloud) {
    std::vector<std::uint32_t> kept;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      if (is_finite(cloud.xyz[i])) kept.push_back(static_cast<std::uint32_t>(i));
    }
    return cloud.gather(kept);
  }

  const PointCloud& all_;
  std::optional<PointCloud> some_;
};

}  // namespace mapcodec
