// SPDX-License-Identifier: GPL-3.0-or-later
// The lossless geometry decoder on any bytes: the first chooses the coordinates' kind, the next two the point
// count.
#include <cstdlib>

#include "mapcodec/codec/lossless_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  if (size < 3) return 0;
  CoordinateFormat format;
  format.kind = static_cast<CoordinateFormat::Kind>(data[0] % 3 + 1);
  format.scale = {0.01, 0.01, 0.001};
  format.offset = {5e5, 4e6, 0};
  const std::uint64_t count = data[1] | data[2] << 8;
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 27;
  const auto points = decode_lossless(ByteSpan(data + 3, size - 3), count, format, {0, 0, 0}, limits);
  if (points && (points->xyz.size() != count || points->voxels.size() != count)) std::abort();
  return 0;
}
