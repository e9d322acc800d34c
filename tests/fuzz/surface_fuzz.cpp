// SPDX-License-Identifier: GPL-3.0-or-later
// The surface decoder, its patches and its levels on any bytes: the first two say how many points are
// claimed, the third how many levels to decode. The rest is a geometry section, and once more a whole tile.
#include <cstdlib>

#include "mapcodec/codec/surface_decoder.hpp"
#include "mapcodec/codec/tile_levels.hpp"
#include "mapcodec/codec/tile_patches.hpp"
#include "mapcodec/codec/tile_segments.hpp"

namespace {

using namespace mapcodec;

void try_section(ByteSpan bytes, std::uint64_t count, unsigned levels, const DecodeLimits& limits) {
  const Quantizer lattice{{0, 0, 0}, 0.01, CoordinateFormat::Kind::f32};
  const auto points = decode_surface(bytes, count, lattice, limits, levels);
  if (points && (points->xyz.size() != count || (!points->voxels.empty() && points->voxels.size() != count)))
    std::abort();
  const auto ends = surface_level_bytes(bytes, count, limits);
  if (ends && ends->back() > bytes.size()) std::abort();
  const auto patches = read_surface_patches(bytes, count, lattice, limits);
  std::uint64_t on = 0;
  for (std::size_t i = 0; patches && i < patches->size(); ++i) on += (*patches)[i].points;
  if (on > count) std::abort();
  const auto owners = read_surface_patch_points(bytes, count, lattice, limits);
  if (owners && owners->patch_of.size() != count) std::abort();
}

void try_tile(ByteSpan bytes, unsigned level, const DecodeLimits& limits) {
  MapSchema schema;
  schema.tile_size_m = 4;
  schema.step_m = 0.01;
  const auto coarse = decode_tile_coarsely(bytes, schema, level, limits);
  const auto header = read_tile_header(bytes);
  if (is_joined(bytes)) return;  // segments_fuzz.cpp
  if (coarse && (!header || coarse->size() != header->points)) std::abort();
  const auto patches = read_tile_patches(bytes, schema, limits);
  if (patches && patches->points != header->points) std::abort();
  (void)count_tile_levels(bytes, schema, limits);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 3) return 0;
  const std::uint64_t count = data[0] | data[1] << 8;
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 27;
  limits.max_points = 1 << 20;
  const ByteSpan rest(data + 3, size - 3);
  try_section(rest, count, data[2] == 0 ? kAllSurfaceLevels : data[2], limits);
  try_tile(rest, data[2], limits);
  return 0;
}
