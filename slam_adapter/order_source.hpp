// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/cloud/point_stream.hpp"

namespace mapcodec {

/// Another source with one more channel: each point's place in it (`kOrderChannel`, u64). The source must
/// outlive it.
class OrderSource final : public PointSource {
 public:
  explicit OrderSource(PointSource& source);

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override {
    return source_.announced_points();
  }
  Result<bool> next(PointCloud& block) override;
  Status rewind() override;
  [[nodiscard]] std::uint64_t dropped_points() const override { return source_.dropped_points(); }
  [[nodiscard]] std::vector<std::string> warnings() const override { return source_.warnings(); }

 private:
  PointSource& source_;
  PointCloud layout_;
  std::uint64_t next_ = 0;
};

}  // namespace mapcodec
