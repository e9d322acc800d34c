// SPDX-License-Identifier: GPL-3.0-or-later
// The surface decoder on any bytes: the first two say how many points are claimed, the third how many levels
// to decode.
#include <cstdlib>

#include "mapcodec/codec/surface_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  if (size < 3) return 0;
  const std::uint64_t count = data[0] | data[1] << 8;
  const unsigned levels = data[2] == 0 ? kAllSurfaceLevels : data[2];
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 27;
  const Quantizer lattice{{0, 0, 0}, 0.01, CoordinateFormat::Kind::f32};
  const auto points = decode_surface(ByteSpan(data + 3, size - 3), count, lattice, limits, levels);
  if (points && (points->xyz.size() != count || (!points->voxels.empty() && points->voxels.size() != count)))
    std::abort();
  return 0;
}
