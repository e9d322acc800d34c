// SPDX-License-Identifier: GPL-3.0-or-later
// The paper decoder on any bytes: the first chooses the colour (0 none, 1 u8, 2 u16; +4: float64
// coordinates), the next three say how many points are claimed.
#include <cstdlib>

#include "mapcodec/codec/paper_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  if (size < 4) return 0;
  MapSchema schema;
  schema.promise = PromiseKind::paper;
  if ((data[0] & 4) != 0) schema.coordinates.kind = CoordinateFormat::Kind::f64;
  const ScalarType scalar = (data[0] & 1) != 0 ? ScalarType::u8 : ScalarType::u16;
  if ((data[0] & 3) != 0) schema.channels.push_back({{"rgb", scalar, 3}, ChannelKept::bounded, 6, {}});
  const std::uint64_t count = data[1] | data[2] << 8 | (data[3] & 15) << 16;
  const ByteSpan bytes(data + 4, size - 4);
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 27;
  const auto cloud = decode_paper(bytes, count, schema, limits);
  if (cloud && (cloud->size() != count || cloud->channels.size() != schema.channels.size())) std::abort();
  const auto patches = read_paper_patches(bytes, count, schema, limits);
  if (cloud && !patches) std::abort();
  if (!patches) return 0;
  std::uint64_t points = 0;
  for (const PlanarPatch& patch : *patches) points += patch.points;
  if (points > count) std::abort();
  return 0;
}
