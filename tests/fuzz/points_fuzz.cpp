// SPDX-License-Identifier: GPL-3.0-or-later
// The points decoder on any bytes: the first three say how many points are claimed.
#include <cstdlib>

#include "mapcodec/codec/octree_decoder.hpp"
#include "mapcodec/codec/points_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  if (size < 3) return 0;
  const std::uint64_t count = data[0] | data[1] << 8 | (data[2] & 15) << 16;
  const ByteSpan bytes(data + 3, size - 3);
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 27;
  const Quantizer quantizer{{0, 0, 0}, 0.01, CoordinateFormat::Kind::f32};
  const auto points = decode_points(bytes, count, quantizer, limits);
  if (points && (points->xyz.size() != count || points->voxels.size() != count)) std::abort();
  const auto octree = decode_octree(bytes, count, data[2] >> 4, limits);
  if (octree && octree->keys.size() != octree->counts.size()) std::abort();
  return 0;
}
