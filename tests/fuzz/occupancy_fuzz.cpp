// SPDX-License-Identifier: GPL-3.0-or-later
// The decoder of occupancy tiles on any payload; what decodes is encoded and decoded again, and is the same.
#include <cstdlib>

#include "mapcodec/codec/occupancy_decoder.hpp"
#include "mapcodec/codec/occupancy_encoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 24;
  const auto piece = decode_occupancy_tile(ByteSpan(data, size), limits);
  if (!piece) return 0;
  if (join_pieces({&*piece, 1}, {}).ok() != (piece->key.level == piece->tree.height)) std::abort();
  const MapSchema schema = occupancy_schema(piece->tree.kind, 0.1);
  const auto cloud = occupancy_points(*piece, schema, limits);
  if (cloud && cloud->size() != piece->tree.leaf_count()) std::abort();
  if (piece->tree.leaf_count() > 5000) return 0;
  const auto again = decode_occupancy_tile(encode_occupancy_tile(*piece, 0.1).bytes);
  if (!again || !(again->tree == piece->tree)) std::abort();
  return 0;
}
