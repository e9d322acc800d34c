// SPDX-License-Identifier: GPL-3.0-or-later
// Tiles that were updated, on any bytes: the first says how many levels to decode, the rest is a payload.
#include <cstdlib>

#include "mapcodec/codec/tile_levels.hpp"
#include "mapcodec/codec/tile_patches.hpp"
#include "mapcodec/codec/tile_segments.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  if (size < 2) return 0;
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 27;
  limits.max_points = 1 << 20;
  MapSchema schema;
  schema.tile_size_m = 4;
  schema.step_m = 0.01;
  const ByteSpan payload(data + 1, size - 1);
  const auto points = decode_tile(payload, schema, limits);
  if (points && points->size() > limits.max_points) std::abort();
  const auto coarse = decode_tile_coarsely(payload, schema, data[0], limits);
  if (coarse && coarse->size() > limits.max_points) std::abort();
  (void)read_tile_patches(payload, schema, limits);
  if (const auto parts = split_segments(payload)) {
    for (const ByteSpan part : *parts) {
      const auto e = read_erasure(part);
      // What was read is written as it was: there is one way to say an erasure.
      if (e && write_erasure(*e) != Bytes(part.begin(), part.end())) std::abort();
    }
  }
  return 0;
}
