// SPDX-License-Identifier: GPL-3.0-or-later
// Clouds and shorthands for the tests of the surface codec.
#pragma once

#include "mapcodec/codec/surface_decoder.hpp"
#include "mapcodec/codec/surface_encoder.hpp"
#include "tests/unit/points_support.hpp"

namespace mapcodec::test {

inline Quantizer steps_of(double step_m, CoordinateFormat::Kind kind = CoordinateFormat::Kind::f64) {
  return {{0, 0, 0}, step_m, kind};
}

/// A level patch of `side` x `side` points, `spacing` [m] apart.
inline Cloud patch(std::size_t side, double spacing) {
  Cloud cloud;
  for (std::size_t i = 0; i < side * side; ++i) {
    cloud.push_back({static_cast<double>(i % side) * spacing, static_cast<double>(i / side) * spacing, 0.1});
  }
  return cloud;
}

/// Clouds that have broken encoders: name and points.
inline std::vector<std::pair<const char*, Cloud>> hard_clouds() {
  Cloud line;
  for (int i = 0; i < 500; ++i) line.push_back({0.01 * i, 0.02 * i, -0.005 * i});
  Cloud axis;
  for (int i = 0; i < 300; ++i) axis.push_back({0.004 * i, 0, 0});
  return {{"one", {{1.25, -3, 0.5}}},
          {"two", {{0, 0, 0}, {1, 1, 1}}},
          {"equal", Cloud(1000, Vec3{3.7, 2.1, -9})},
          {"line", line},
          {"axis", axis},
          {"patch", patch(60, 0.01)},
          {"room", room(4000, 2, 5)},
          {"sparse", sparse(500, 10, 6)},
          {"far", moved(room(3000, 1, 7), {1e6, -2e6, 3e5})}};
}

}  // namespace mapcodec::test
