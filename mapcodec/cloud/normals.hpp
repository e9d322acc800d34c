// SPDX-License-Identifier: GPL-3.0-or-later
// Which channels are normals, and turning them with their points.
#pragma once

#include <optional>
#include <string>

#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// Whether a channel is normals that can be turned: "normal", three components, f32 or f64.
[[nodiscard]] inline bool is_normals(const ChannelInfo& c) {
  return c.name == "normal" && c.components == 3 &&
         (c.scalar == ScalarType::f32 || c.scalar == ScalarType::f64);
}

/// The first channel that is normals by its name but of a form that is not turned: integers, or components
/// apart from each other.
[[nodiscard]] inline std::optional<std::string> unturned_normals(const PointCloud& layout) {
  for (const Channel& c : layout.channels) {
    for (const char* name : {"normal", "normals", "normal_x", "nx"}) {
      if (c.info.name == name && !is_normals(c.info)) return c.info.name;
    }
  }
  return std::nullopt;
}

namespace normals_detail {

template <class Scalar, class Rotate>
void turn(Channel& normals, const Rotate& rotate) {
  for (std::size_t i = 0; i < normals.size(); ++i) {
    Vec3 n;
    for (std::size_t d = 0; d < 3; ++d) n[d] = double(normals.get<Scalar>(i, d));
    n = rotate(n);
    for (std::size_t d = 0; d < 3; ++d) normals.set(i, static_cast<Scalar>(n[d]), d);
  }
}

}  // namespace normals_detail

/// Turns the cloud's normals, if it has any (is_normals). @param rotate  Vec3 -> Vec3. Threads: pure.
template <class Rotate>
void turn_normals(PointCloud& cloud, const Rotate& rotate) {
  Channel* normals = cloud.find("normal");
  if (normals == nullptr || !is_normals(normals->info)) return;
  if (normals->info.scalar == ScalarType::f32) normals_detail::turn<float>(*normals, rotate);
  if (normals->info.scalar == ScalarType::f64) normals_detail::turn<double>(*normals, rotate);
}

}  // namespace mapcodec
