// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/coding_plan.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

// Surfaces that take less than this never lost to points on any cloud: these are not tried then.
constexpr double kClearlySurface = 0.5;  // bits per point

double squares(const EncodedTile& t, double rms_m) {
  return static_cast<double>(t.input_points) * rms_m * rms_m;
}

double geometry_bits(const EncodedTile& t) {
  return 8 * static_cast<double>(t.geometry_bytes);
}

double cost(const EncodedTile& t, double bit_price_m2) {
  const double error = (squares(t, t.rms_forward_m) + squares(t, t.rms_backward_m)) / 2;
  return error + bit_price_m2 * geometry_bits(t);
}

Result<EncodedTile> encode_as(CodecId codec, double step_m, const PointCloud& tile, const MapSchema& schema,
                              const CodingPlan& plan, TileMemo* memo = nullptr) {
  TileSettings settings = plan.tiles;
  settings.codec = codec;
  settings.step_m = step_m;
  return encode_tile(tile, schema, settings, memo);
}

Result<EncodedTile> encode_cheapest(const PointCloud& tile, const MapSchema& schema, const CodingPlan& plan,
                                    TileMemo* memo) {
  const double price_m2 = plan.tiles.trade.bit_price * plan.step_m * plan.step_m;
  const double voxel_m = plan.voxels_per_step() * plan.step_m;
  if (plan.fixed) {
    return encode_as(*plan.fixed, plan.fixed == CodecId::surface ? plan.step_m : voxel_m, tile, schema, plan,
                     memo);
  }
  auto surface = encode_as(CodecId::surface, plan.step_m, tile, schema, plan, memo);
  // Too wide at this step, or too far away: points have more room.
  if (!surface.ok()) return encode_as(CodecId::points, voxel_m, tile, schema, plan);
  if (geometry_bits(*surface) < kClearlySurface * static_cast<double>(tile.size())) return surface;
  const auto points = encode_as(CodecId::points, voxel_m, tile, positions_alone(schema), plan);
  if (!points.ok() || cost(*surface, price_m2) <= cost(*points, price_m2)) return surface;
  return encode_as(CodecId::points, voxel_m, tile, schema, plan);
}

}  // namespace

Result<EncodedTile> encode_by_plan(const PointCloud& tile, const MapSchema& schema, const CodingPlan& plan,
                                   TileMemo* memo) {
  switch (plan.choice) {
    case CodecChoice::cheapest:
      return encode_cheapest(tile, schema, plan, memo);
    case CodecChoice::surface:
      return encode_as(CodecId::surface, plan.step_m, tile, schema, plan, memo);
    case CodecChoice::points:
      break;
  }
  return encode_as(plan.tiles.codec, plan.step_m, tile, schema, plan);
}

void CodedSum::add(const EncodedTile& t) {
  const auto n = static_cast<double>(t.input_points);
  points_ += n;
  forward_ += squares(t, t.rms_forward_m);
  backward_ += squares(t, t.rms_backward_m);
  color_ += n * t.errors.color_error;
  least_color_ += n * t.least_color_error;
  density_ += n * t.errors.density_error;
  max_axis_ = std::max(max_axis_, t.errors.max_axis_error_m);
  bytes_ += static_cast<double>(t.bytes.size());
  geometry_bytes_ += static_cast<double>(t.geometry_bytes);
  if (t.codec == CodecId::surface) surface_points_ += n;
}

TileErrors CodedSum::errors() const {
  if (points_ == 0) return {};
  return {rms_m(), max_axis_, color_ / points_, density_ / points_};
}

double worth_of_density(double bits_per_point, double density_error, double rms_m) {
  // Points that lie an rms off are 0.8 of it off along an axis, on average, and in other voxels of 10 cm by
  // that much of their side: that, and what is hardly seen, is free. Beyond it a hundredth has to save so
  // many hundredths of a bit, but no more than that share of the coding.
  constexpr double kHardlySeen = 0.06, kMovedPerMetre = 8, kWorth = 0.5, kShare = 5;
  const double free = kHardlySeen + kMovedPerMetre * rms_m;
  return std::min(kWorth, kShare * bits_per_point) * std::max(0.0, density_error - free);
}

MapSchema positions_alone(MapSchema schema) {
  for (ChannelSchema& c : schema.channels) c.kept = ChannelKept::dropped;
  return schema;
}

}  // namespace mapcodec
