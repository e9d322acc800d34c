// SPDX-License-Identifier: GPL-3.0-or-later
// The channel decoder on any bytes: the first byte chooses the channel, the second the number of points.
#include <algorithm>
#include <cstdlib>

#include "mapcodec/attribute/channel_decoder.hpp"
#include "mapcodec/geometry/morton.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  if (size < 2) return 0;
  ChannelSchema schema;
  const bool color = (data[0] & 16) != 0;
  schema.info = {color ? "rgb" : "any", static_cast<ScalarType>(data[0] % 10 + 1),
                 std::uint8_t(color ? 3 : 1 + (data[0] >> 5))};
  std::vector<VoxelCoord> voxels;
  for (std::uint64_t i = 0; i < data[1]; ++i) voxels.push_back(morton_decode(i * i / 2 * 5));
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 26;
  const auto channel = decode_channel(ByteSpan(data + 2, size - 2), schema, voxels, limits);
  if (channel && channel->size() != voxels.size()) std::abort();
  return 0;
}
