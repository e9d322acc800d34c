// SPDX-License-Identifier: GPL-3.0-or-later
// Point sources and clouds for the tests of parallel/.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <functional>
#include <random>
#include <utility>

#include "mapcodec/cloud/point_stream.hpp"

namespace mapcodec::test {

/// A cloud in blocks; may fail, or change between its passes.
class BlockSource final : public PointSource {
 public:
  explicit BlockSource(PointCloud cloud, std::size_t block = 1000)
      : cloud_(std::move(cloud)), layout_(cloud_.like()), block_(block) {}

  const PointCloud& layout() const override { return layout_; }
  std::optional<std::uint64_t> announced_points() const override { return announced; }
  Result<bool> next(PointCloud& block) override {
    block = layout_;
    if (at_ >= fail_at) return make_error(ErrorCode::kTruncated, "the file ends too early");
    const std::size_t end = std::min(cloud_.size(), at_ + block_);
    block.append(cloud_, at_, end);
    return std::exchange(at_, end) < end;
  }
  Status rewind() override {
    at_ = 0;
    ++rewinds;
    if (on_rewind) on_rewind(cloud_);
    return {};
  }
  std::uint64_t dropped_points() const override { return 7; }
  std::vector<std::string> warnings() const override { return {"a warning of the source"}; }

  std::optional<std::uint64_t> announced;
  std::size_t fail_at = static_cast<std::size_t>(-1);
  std::function<void(PointCloud&)> on_rewind;
  int rewinds = 0;

 private:
  PointCloud cloud_, layout_;
  std::size_t block_;
  std::size_t at_ = 0;
};

/// Points with the channels "rgb", "time" (their index) and "ring" (all 5).
inline PointCloud with_channels(std::vector<Vec3> xyz) {
  PointCloud c;
  c.xyz = std::move(xyz);
  c.channels = {{{"rgb", ScalarType::u8, 3}, {}},
                {{"time", ScalarType::f64, 1}, {}},
                {{"ring", ScalarType::u16, 1}, {}}};
  c.resize(c.xyz.size());
  for (std::size_t i = 0; i < c.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      c.channels[0].set<std::uint8_t>(i, static_cast<std::uint8_t>(i * (k + 3)), k);
    c.channels[1].set<double>(i, static_cast<double>(i));
    c.channels[2].set<std::uint16_t>(i, 5);
  }
  return c;
}

/// A floor, dense around its middle, and a wall: what maps look like. Float coordinates.
inline std::vector<Vec3> floor_and_wall(std::size_t count, double extent_m = 50, const Vec3& at = {0, 0, 0}) {
  std::mt19937_64 random(count);
  std::normal_distribution<double> middle(0, extent_m / 10);
  std::uniform_real_distribution<double> wide(-extent_m / 2, extent_m / 2);
  std::vector<Vec3> xyz;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3 p = i % 3 == 0   ? Vec3{wide(random), wide(random), 0}
             : i % 3 == 1 ? Vec3{middle(random), middle(random), 0}
                          : Vec3{wide(random), extent_m / 2, std::abs(middle(random))};
    for (std::size_t d = 0; d < 3; ++d) p[d] = static_cast<double>(static_cast<float>(p[d])) + at[d];
    xyz.push_back(p);
  }
  return xyz;
}

/// Equal in every bit, NaN and -0 too.
inline bool same_bits(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0);
}
inline bool same_bits(const PointCloud& a, const PointCloud& b) {
  if (!same_bits(a.xyz, b.xyz) || a.channels.size() != b.channels.size()) return false;
  for (std::size_t c = 0; c < a.channels.size(); ++c) {
    if (!(a.channels[c].info == b.channels[c].info) || a.channels[c].data != b.channels[c].data) return false;
  }
  return true;
}

}  // namespace mapcodec::test
