// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstring>

#include "mapcodec/codec/paper_encoder.hpp"
#include "mapcodec/geometry/triangle_sampler.hpp"

namespace mapcodec::test {

inline double unit(SplitMix& random) {
  return static_cast<double>(random.next() >> 11) * 0x1p-53;
}

inline Channel colors(std::size_t count, ScalarType scalar) {
  const ChannelInfo info{"rgb", scalar, 3};
  return {info, Bytes(count * info.stride())};
}

inline void set_color(Channel& channel, std::size_t i, std::array<unsigned, 3> rgb) {
  for (std::size_t c = 0; c < 3; ++c) {
    if (channel.info.scalar == ScalarType::u8)
      channel.set<std::uint8_t>(i, static_cast<std::uint8_t>(rgb[c]), c);
    if (channel.info.scalar == ScalarType::u16)
      channel.set<std::uint16_t>(i, static_cast<std::uint16_t>(rgb[c]), c);
  }
}

/// A floor with a hole, a wall and some points in the air; the floor is half red, half blue. `at` is its
/// corner.
inline PointCloud make_room(std::size_t count, const Vec3& at = {0, 0, 0}, bool colored = true,
                            ScalarType scalar = ScalarType::u8) {
  PointCloud cloud;
  if (at[0] > 1000) cloud.coordinates.kind = CoordinateFormat::Kind::f64;
  if (colored) cloud.channels.push_back(colors(count, scalar));
  SplitMix random(count);
  const unsigned bright = scalar == ScalarType::u8 ? 200 : 50000;
  while (cloud.size() < count) {
    const double u = 3 * unit(random), v = 2 * unit(random), noise = 0.01 * unit(random);
    const unsigned kind = random.next() % 20;
    if (kind < 12 && std::hypot(u - 1.5, v - 1) < 0.5) continue;
    Vec3 p{u, v, noise};
    if (kind >= 12) p = {u, noise, v};
    if (kind == 19) p = {u, v, 0.2 + 1.5 * unit(random)};
    const std::size_t i = cloud.size();
    cloud.xyz.push_back({at[0] + p[0], at[1] + p[1], at[2] + p[2]});
    if (colored) set_color(cloud.channels[0], i, {u < 1.5 ? bright : 0, 50, u < 1.5 ? 0 : bright});
  }
  return cloud;
}

inline MapSchema schema_of(const PointCloud& cloud) {
  MapSchema schema;
  schema.promise = PromiseKind::paper;
  schema.coordinates = cloud.coordinates;
  for (const Channel& c : cloud.channels) schema.channels.push_back({c.info, ChannelKept::bounded, 6, {}});
  return schema;
}

inline PaperSettings small_settings(bool raw = false) {
  PaperSettings s;
  s.min_points = 50;
  s.raw = raw;
  return s;
}

}  // namespace mapcodec::test
