// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/channel_encoder.hpp"

#include "mapcodec/attribute/channel_decoder.hpp"
#include "mapcodec/attribute/channel_kind.hpp"
#include "mapcodec/attribute/color_decoder.hpp"
#include "mapcodec/attribute/color_encoder.hpp"
#include "mapcodec/attribute/value_encoder.hpp"

namespace mapcodec {
namespace {

double largest_error(const Channel& a, const Channel& b) {
  double most = 0;
  visit_scalar(a.info.scalar, [&](auto zero) {
    using T = decltype(zero);
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t c = 0; c < a.info.components; ++c) {
        const T x = a.get<T>(i, c), y = b.get<T>(i, c);
        // Values in full may be NaN.
        if (std::memcmp(&x, &y, sizeof(T)) == 0) continue;
        most = std::max(most, static_cast<double>(x > y ? x - y : y - x));
      }
    }
  });
  return most;
}

Result<ChannelEncoding> encode_by_values(const ChannelSchema& schema, const Channel& values,
                                         std::span<const VoxelCoord> voxels, Effort effort) {
  ChannelEncoding e;
  e.bytes.push_back(kValuesSection);
  const Bytes body = encode_values(schema, values, voxels, effort);
  e.bytes.insert(e.bytes.end(), body.begin(), body.end());
  if (schema.kept == ChannelKept::exact) {
    e.decoded = values;
    return e;
  }
  MAPCODEC_ASSIGN(e.decoded,
                  decode_channel(e.bytes, schema, voxels, {~std::uint64_t{0}, ~std::uint64_t{0}, 256}));
  e.error = largest_error(values, e.decoded);
  return e;
}

}  // namespace

Status check_channel(const ChannelSchema& schema, const Channel& values, std::span<const VoxelCoord> voxels) {
  const auto refuse = [&](const char* why) {
    return make_error(ErrorCode::kInvalidArgument, "channel '" + schema.info.name + "': " + why);
  };
  if (schema.kept != ChannelKept::exact && schema.kept != ChannelKept::bounded)
    return refuse("has nothing to encode");
  if (values.info != schema.info || schema.info.stride() == 0)
    return refuse("is not laid out as its schema says");
  if (values.data.size() != voxels.size() * schema.info.stride())
    return refuse("has not one value per point");
  if (!(schema.bound >= 0) || !std::isfinite(schema.bound)) return refuse("has no proper bound");
  return {};
}

Result<ChannelEncoding> encode_channel(const ChannelSchema& schema, const Channel& values,
                                       std::span<const VoxelCoord> voxels, Effort effort) {
  MAPCODEC_TRY(check_channel(schema, values, voxels));
  if (voxels.empty()) return ChannelEncoding{{}, values, 0};
  if (schema.kept == ChannelKept::bounded && schema.bound > 0 && is_color(schema.info)) {
    return encode_color(values, schema.bound, voxels, effort);
  }
  return encode_by_values(schema, values, voxels, effort);
}

}  // namespace mapcodec
