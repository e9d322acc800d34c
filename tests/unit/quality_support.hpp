// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <random>

#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec::test {

/// A channel of `count` zeros.
inline Channel zero_channel(const char* name, ScalarType scalar, std::uint8_t components, std::size_t count) {
  Channel c;
  c.info.name = name;
  c.info.scalar = scalar;
  c.info.components = components;
  c.data.resize(count * c.info.stride());
  return c;
}

/// `count` points in a cube of `side_m` around `centre`, with random u8x3 colours. Small lattices make ties.
inline PointCloud random_cloud(std::size_t count, double side_m, Vec3 centre, unsigned seed,
                               double lattice_m = 0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-side_m / 2, side_m / 2);
  PointCloud cloud;
  cloud.channels.push_back(zero_channel("rgb", ScalarType::u8, 3, count));
  for (std::uint8_t& v : cloud.channels[0].data) v = static_cast<std::uint8_t>(random());
  for (std::size_t i = 0; i < count; ++i) {
    Vec3 p = centre;
    for (double& v : p) {
      const double x = place(random);
      v += lattice_m > 0 ? std::round(x / lattice_m) * lattice_m : x;
    }
    cloud.xyz.push_back(p);
  }
  return cloud;
}

inline PointCloud points(std::vector<Vec3> xyz) {
  PointCloud cloud;
  cloud.xyz = std::move(xyz);
  return cloud;
}

}  // namespace mapcodec::test
