// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

#include "mapcodec/cloud/point_stream.hpp"

namespace mapcodec {

/// A cloud in memory as a PointSource. The cloud must outlive it.
class CloudSource final : public PointSource {
 public:
  explicit CloudSource(const PointCloud& cloud) : cloud_(cloud), layout_(cloud.like()) {}

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return cloud_.size(); }
  Result<bool> next(PointCloud& block) override {
    constexpr std::size_t kBlock = 65536;
    block = layout_;
    const std::size_t end = std::min(cloud_.size(), at_ + kBlock);
    block.append(cloud_, at_, end);
    at_ = end;
    return !block.empty();
  }
  Status rewind() override {
    at_ = 0;
    return {};
  }
  /// Nothing is dropped here: who writes a lossy map from memory gives finite points.
  [[nodiscard]] std::uint64_t dropped_points() const override { return 0; }

 private:
  const PointCloud& cloud_;
  PointCloud layout_;
  std::size_t at_ = 0;
};

}  // namespace mapcodec
