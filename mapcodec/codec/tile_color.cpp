// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/tile_color.hpp"

#include <array>
#include <cmath>

#include "mapcodec/attribute/color_decoder.hpp"
#include "mapcodec/attribute/color_encoder.hpp"

namespace mapcodec {
namespace {

using Rgb = std::array<double, 3>;

Rgb color_at(const Channel& c, std::size_t i) {
  if (c.info.scalar == ScalarType::u16) {
    return {c.get<std::uint16_t>(i, 0) / 257.0, c.get<std::uint16_t>(i, 1) / 257.0,
            c.get<std::uint16_t>(i, 2) / 257.0};
  }
  return {double(c.at(i)[0]), double(c.at(i)[1]), double(c.at(i)[2])};
}

double distance(const Rgb& a, const Rgb& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/// Calls f(begin, end) for each run of points that share a voxel.
template <class F>
void for_each_voxel(std::span<const VoxelCoord> voxels, F&& f) {
  for (std::size_t begin = 0, end = 0; begin < voxels.size(); begin = end) {
    for (end = begin + 1; end < voxels.size() && voxels[end] == voxels[begin];) ++end;
    f(begin, end);
  }
}

/// All points of a voxel get their mean colour.
Channel merge_voxels(const Channel& values, std::span<const VoxelCoord> voxels) {
  Channel merged = values;
  const auto merge = [&](auto zero) {
    using T = decltype(zero);
    for_each_voxel(voxels, [&](std::size_t begin, std::size_t end) {
      for (std::size_t c = 0; c < 3; ++c) {
        std::uint64_t sum = (end - begin) / 2;
        for (std::size_t i = begin; i < end; ++i) sum += values.get<T>(i, c);
        for (std::size_t i = begin; i < end; ++i) merged.set<T>(i, static_cast<T>(sum / (end - begin)), c);
      }
    });
  };
  if (values.info.scalar == ScalarType::u16) {
    merge(std::uint16_t{});
  } else {
    merge(std::uint8_t{});
  }
  return merged;
}

double squared_distance(const Vec3& a, const Vec3& b) {
  double s = 0;
  for (std::size_t d = 0; d < 3; ++d) s += (a[d] - b[d]) * (a[d] - b[d]);
  return s;
}

/// Mean distance of `color` to those of points [begin, end): of at most about 64 of them, evenly spread,
/// since a voxel may hold a whole tile.
double mean_distance(const Rgb& color, const Channel& decoded, std::size_t begin, std::size_t end) {
  const std::size_t stride = (end - begin + 63) / 64;
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t j = begin; j < end; j += stride, ++count) sum += distance(color, color_at(decoded, j));
  return sum / static_cast<double>(count);
}

/// Mean of the two directions, each the mean RGB distance to the nearest neighbour: of an original the points
/// at its voxel's centre (any of them is nearest, so the mean over them), of a decoded point the original of
/// its voxel that is nearest to the centre.
double measured_error(const ColorContext& tile, const Channel& values, const Channel& decoded) {
  double forth = 0, back = 0;
  for_each_voxel(tile.voxels, [&](std::size_t begin, std::size_t end) {
    std::size_t nearest = begin;
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t i = begin; i < end; ++i) {
      const double d = squared_distance(tile.original[tile.order[i]], tile.decoded[i]);
      if (d < best) {
        best = d;
        nearest = i;
      }
      forth += mean_distance(color_at(values, i), decoded, begin, end);
    }
    for (std::size_t i = begin; i < end; ++i)
      back += distance(color_at(values, nearest), color_at(decoded, i));
  });
  return (forth + back) / (2.0 * static_cast<double>(tile.voxels.size()));
}

}  // namespace

double least_color_error(const Channel& values, const ColorContext& context) {
  return measured_error(context, values, merge_voxels(values, context.voxels));
}

Result<ChannelEncoding> encode_tile_color(const ChannelSchema& channel, const Channel& values,
                                          const ColorContext& context, Effort effort) {
  // Points at one position cannot be told apart by their neighbours' distance: different colours there would
  // cost bits and raise the measured error.
  const Channel merged = merge_voxels(values, context.voxels);
  const double floor = measured_error(context, values, merged) / channel.bound;
  if (context.voxels.empty() || !(channel.bound > 0) || !is_color(channel.info)) {
    MAPCODEC_ASSIGN(ChannelEncoding e, encode_channel(channel, merged, context.voxels, effort));
    e.error = measured_error(context, values, e.decoded);
    return e;
  }
  MAPCODEC_TRY(check_channel(channel, merged, context.voxels));
  ColorEncoder encoder(merged, context.voxels);
  double bound = channel.bound;
  // The loss of merging and that of coding add up about as independent errors do.
  bound *= std::max(0.3, std::sqrt(std::max(0.0, 1 - floor * floor)));
  constexpr int kTries = 4;
  for (int i = 0;; ++i) {
    ChannelEncoding e = encoder.encode(bound, effort);
    e.error = measured_error(context, values, e.decoded);
    if (e.error <= channel.bound || floor >= 1 || i + 1 == kTries) return e;
    bound *= std::max(0.5, 0.97 * channel.bound / e.error);
  }
}

}  // namespace mapcodec
