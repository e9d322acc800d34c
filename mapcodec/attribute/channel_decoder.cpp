// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/channel_decoder.hpp"

#include "mapcodec/attribute/channel_kind.hpp"
#include "mapcodec/attribute/color_decoder.hpp"
#include "mapcodec/attribute/value_decoder.hpp"

namespace mapcodec {
namespace {

Result<Channel> repeat_constant(const ChannelSchema& schema, std::size_t count, const DecodeLimits& limits) {
  const std::size_t stride = schema.info.stride();
  if (schema.constant.size() != stride || stride == 0) {
    return make_error(ErrorCode::kMalformed, "channel '" + schema.info.name + "' has no proper constant");
  }
  if (count > limits.max_points || count > limits.max_bytes / stride) {
    return make_error(ErrorCode::kLimitExceeded,
                      "channel '" + schema.info.name + "' would need too much memory");
  }
  Channel c{schema.info, Bytes(count * stride)};
  for (std::size_t i = 0; i < count; ++i) std::memcpy(c.at(i), schema.constant.data(), stride);
  return c;
}

}  // namespace

Result<Channel> decode_channel(ByteSpan bytes, const ChannelSchema& schema,
                               std::span<const VoxelCoord> voxels, const DecodeLimits& limits) {
  if (schema.kept == ChannelKept::constant) return repeat_constant(schema, voxels.size(), limits);
  if (voxels.empty()) return Channel{schema.info, {}};
  if (bytes.empty())
    return make_error(ErrorCode::kTruncated, "channel '" + schema.info.name + "' is missing", 0);
  if (schema.info.stride() == 0) return make_error(ErrorCode::kMalformed, "a channel of no type");
  const ByteSpan body = bytes.subspan(1);
  if (bytes[0] == kValuesSection) return decode_values(body, schema.info, voxels, limits);
  if (bytes[0] == kColorSection && is_color(schema.info))
    return decode_color(body, schema.info, voxels, limits);
  return make_error(ErrorCode::kMalformed, "channel '" + schema.info.name + "' has an unknown section", 0);
}

}  // namespace mapcodec
