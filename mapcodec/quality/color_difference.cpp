// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/color_difference.hpp"

namespace mapcodec {

std::optional<Colors> Colors::of(const PointCloud& cloud) {
  const Channel* c = cloud.find("rgb");
  if (c == nullptr || c->info.components != 3 || c->size() != cloud.size()) return std::nullopt;
  if (c->info.scalar != ScalarType::u8 && c->info.scalar != ScalarType::u16) return std::nullopt;
  return Colors(*c);
}

Vec3 Colors::at(std::size_t i) const {
  if (channel_->info.scalar == ScalarType::u8) {
    const std::uint8_t* c = channel_->at(i);
    return {double(c[0]), double(c[1]), double(c[2])};
  }
  return {channel_->get<std::uint16_t>(i, 0) / 257.0, channel_->get<std::uint16_t>(i, 1) / 257.0,
          channel_->get<std::uint16_t>(i, 2) / 257.0};
}

ColorStats color_difference(const Colors& from, const Colors& to, const Nearest& nearest) {
  ColorStats s;
  for (std::size_t i = 0; i < nearest.index.size(); ++i) {
    const Vec3 p = from.at(i), q = to.at(nearest.index[i]);
    const double r = p[0] - q[0], g = p[1] - q[1], b = p[2] - q[2];
    s.mean_distance += std::sqrt(r * r + g * g + b * b);
    const double luma = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    s.luma_mse += luma * luma;
  }
  const auto n = static_cast<double>(nearest.index.size());
  return {s.mean_distance / n, s.luma_mse / n};
}

}  // namespace mapcodec
