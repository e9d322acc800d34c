// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_tile.hpp"

#include <cmath>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/codec/surface_color.hpp"
#include "mapcodec/codec/surface_encoder.hpp"
#include "mapcodec/codec/tile_sections.hpp"
#include "mapcodec/quality/density.hpp"
#include "mapcodec/quality/grid_nearest.hpp"

namespace mapcodec {
namespace {

constexpr std::uint8_t kUsualVoxelShift =
    7;  // a quarter of the surface step, where no colour asks for another

double root_mean(const Nearest& nearest) {
  double sum = 0;
  for (const double s : nearest.squared) sum += s;
  return std::sqrt(sum / static_cast<double>(nearest.squared.size()));
}

/// Largest error along an axis to the Euclidean neighbour: a bound for that to the nearest along all axes.
double largest_axis_distance(std::span<const Vec3> from, std::span<const Vec3> to, const Nearest& nearest) {
  double most = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vec3& q = to[nearest.index[i]];
    for (std::size_t d = 0; d < 3; ++d) most = std::max(most, std::abs(from[i][d] - q[d]));
  }
  return most;
}

void set_rms(double forward_m, double backward_m, SurfaceTile& r) {
  r.rms_forward_m = forward_m;
  r.rms_backward_m = backward_m;
  r.errors.rms_m = std::max(forward_m, backward_m);
}

void measure(const std::vector<Vec3>& original, const std::vector<Vec3>& decoded, const NearestPair& near,
             SurfaceTile& r) {
  set_rms(root_mean(near.forth), root_mean(near.back), r);
  r.errors.max_axis_error_m = std::max(largest_axis_distance(original, decoded, near.forth),
                                       largest_axis_distance(decoded, original, near.back));
  r.errors.density_error = density_error(original, decoded);
}

bool is_bounded_color(const ChannelSchema& c) {
  return c.kept == ChannelKept::bounded && c.info.name == "rgb" && c.info.components == 3 &&
         (c.info.scalar == ScalarType::u8 || c.info.scalar == ScalarType::u16);
}

/// The values of a channel on the decoded points, in tree order.
Channel on_decoded(const ChannelSchema& channel, const Channel& original, const NearestPair& near,
                   const SamePositions& ties) {
  const bool color = channel.info.name == "rgb" && channel.info.components == 3 &&
                     (channel.info.scalar == ScalarType::u8 || channel.info.scalar == ScalarType::u16);
  return color ? transfer_color(original, near, ties) : transfer_values(original, near.back);
}

class TileChannels {
 public:
  TileChannels(const PointCloud& tile, const MapSchema& schema, const NearestPair& near, Effort effort,
               double color_slope)
      : tile_(tile),
        schema_(schema),
        near_(near),
        effort_(effort),
        color_slope_(color_slope),
        coded_(coded_channels(schema, CodecId::surface)) {}

  /// Colour first: it decides on the voxels.
  Status encode(SurfaceEncoding& encoding, SurfaceTile& r) {
    if (coded_.empty()) return {};
    r.channels.resize(coded_.size());
    std::size_t color = coded_.size();
    std::uint8_t shift = std::clamp(kUsualVoxelShift, surface::least_voxel_shift(encoding.header.depth),
                                    surface::most_voxel_shift(encoding.header.depth));
    for (std::size_t i = 0; i < coded_.size() && color == coded_.size(); ++i) {
      if (is_bounded_color(schema_.channels[coded_[i]])) color = i;
    }
    if (color < coded_.size()) {
      const std::size_t c = coded_[color];
      MAPCODEC_ASSIGN(SurfaceColor e,
                      encode_surface_color(schema_.channels[c], tile_.channels[c], near_,
                                           SamePositions(tile_.xyz), encoding, effort_, color_slope_));
      r.channels[color] = std::move(e.bytes);
      r.errors.color_error = e.error;
      r.least_color_error = e.least_error;
      shift = e.voxel_shift;
    }
    const surface::VoxelOrder sorted = set_voxels(encoding, shift);
    for (std::size_t i = 0; i < coded_.size(); ++i) {
      if (i == color) continue;
      MAPCODEC_ASSIGN(r.channels[i], encode_other(coded_[i], sorted));
    }
    return {};
  }

 private:
  [[nodiscard]] Result<Bytes> encode_other(std::size_t c, const surface::VoxelOrder& sorted) const {
    const ChannelSchema& schema = schema_.channels[c];
    const Channel values = on_decoded(schema, tile_.channels[c], near_, SamePositions(tile_.xyz));
    Channel ordered{values.info, Bytes(values.data.size())};
    for (std::size_t i = 0; i < sorted.order.size(); ++i) {
      std::memcpy(ordered.at(i), values.at(sorted.order[i]), values.info.stride());
    }
    MAPCODEC_ASSIGN(ChannelEncoding e, encode_channel(schema, ordered, sorted.voxels, effort_));
    return std::move(e.bytes);
  }

  const PointCloud& tile_;
  const MapSchema& schema_;
  const NearestPair& near_;
  Effort effort_;
  double color_slope_;
  std::vector<std::size_t> coded_;
};

}  // namespace

Result<SurfaceTile> encode_surface_tile(const PointCloud& tile, const MapSchema& schema, double step_m,
                                        const TileSettings& settings) {
  const Quantizer lattice{schema.origin, step_m, schema.coordinates.kind};
  MAPCODEC_ASSIGN(SurfaceEncoding e, encode_surface(tile.xyz, lattice, {settings.effort, settings.borders}));
  SurfaceTile r;
  for (const Vec3& p : e.decoded) r.bounds.add(p);
  if (settings.rough_errors && coded_channels(schema, CodecId::surface).empty()) {
    const RoughErrors rough = estimate_errors(tile.xyz, e.decoded);
    set_rms(std::sqrt(rough.forth), std::sqrt(rough.back), r);
  } else {
    const NearestPair near = find_nearest_pair(tile.xyz, e.decoded);
    measure(tile.xyz, e.decoded, near, r);
    MAPCODEC_TRY(TileChannels(tile, schema, near, settings.effort, settings.color_slope).encode(e, r));
  }
  r.geometry = std::move(e.bytes);
  return r;
}

}  // namespace mapcodec
