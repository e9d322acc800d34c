// SPDX-License-Identifier: GPL-3.0-or-later
// Surfaces of voxels and channels over them, from fixed seeds.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include "mapcodec/attribute/channel_decoder.hpp"
#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/geometry/morton.hpp"

namespace mapcodec::test {

/// `count` points on a wavy sheet, Morton-sorted; `side` voxels across, so that a small one gives shared
/// voxels.
inline std::vector<VoxelCoord> wavy_voxels(std::size_t count, std::uint32_t side) {
  std::mt19937 random(7);
  std::vector<std::uint64_t> keys;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t x = random() % side, y = random() % side;
    const auto z =
        static_cast<std::uint32_t>(side * (0.5 + 0.2 * std::sin(6.0 * x / side) * std::cos(5.0 * y / side)));
    keys.push_back(morton_encode({x, y, z}));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<VoxelCoord> voxels;
  for (const std::uint64_t k : keys) voxels.push_back(morton_decode(k));
  return voxels;
}

/// value(voxel, component, a number from a fixed sequence).
template <class T, class F>
Channel make_channel(std::string name, ScalarType scalar, std::uint8_t components,
                     const std::vector<VoxelCoord>& voxels, F&& value) {
  Channel c{{std::move(name), scalar, components}, {}};
  c.data.resize(voxels.size() * c.info.stride());
  std::mt19937 random(11);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    for (std::size_t k = 0; k < components; ++k)
      c.set<T>(i, static_cast<T>(value(voxels[i], k, random())), k);
  }
  return c;
}

inline Channel smooth_rgb(const std::vector<VoxelCoord>& voxels, std::uint32_t noise) {
  return make_channel<std::uint8_t>("rgb", ScalarType::u8, 3, voxels,
                                    [&](const VoxelCoord& v, std::size_t c, std::uint32_t r) {
                                      return 100 + 60 * std::sin(v[0] * 0.02 + static_cast<double>(c)) +
                                             v[1] / 16 % 32 + (noise > 0 ? r % noise : 0);
                                    });
}

inline ChannelSchema schema_of(const Channel& c, ChannelKept kept = ChannelKept::exact, double bound = 0) {
  return {c.info, kept, bound, {}};
}

inline ChannelEncoding encode(const ChannelSchema& schema, const Channel& c,
                              const std::vector<VoxelCoord>& voxels) {
  auto e = encode_channel(schema, c, voxels, Effort::standard);
  return e ? std::move(*e) : ChannelEncoding{};
}

}  // namespace mapcodec::test
