// SPDX-License-Identifier: GPL-3.0-or-later
// Clouds for the tests of the points codec.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec::test {

using Cloud = std::vector<Vec3>;

inline double uniform(std::mt19937& rng) {
  return static_cast<double>(rng()) / 4294967296.0;
}

/// A noisy wall and floor of `count` points, side `size` [m], with some doubles.
inline Cloud room(std::size_t count, double size, std::uint32_t seed) {
  std::mt19937 rng(seed);
  Cloud cloud;
  while (cloud.size() < count) {
    const double u = uniform(rng) * size, v = uniform(rng) * size, noise = 0.004 * uniform(rng);
    cloud.push_back(rng() % 2 == 0 ? Vec3{u, v, noise} : Vec3{0.3 * v + noise, u, v});
    if (rng() % 16 == 0 && cloud.size() < count) cloud.push_back(cloud[rng() % cloud.size()]);
  }
  return cloud;
}

/// Points alone in a large cube.
inline Cloud sparse(std::size_t count, double size, std::uint32_t seed) {
  std::mt19937 rng(seed);
  Cloud cloud(count);
  for (Vec3& p : cloud) {
    for (double& x : p) x = uniform(rng) * size;
  }
  return cloud;
}

inline Cloud moved(Cloud cloud, const Vec3& by) {
  for (Vec3& p : cloud) {
    for (std::size_t d = 0; d < 3; ++d) p[d] += by[d];
  }
  return cloud;
}

}  // namespace mapcodec::test
