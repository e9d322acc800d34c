// SPDX-License-Identifier: GPL-3.0-or-later
// A `paper` tile read, before its points are drawn. Decode side.
#pragma once

#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/cloud/planar_patch.hpp"

namespace mapcodec::paper {

struct Content {
  std::vector<PlanarPatch> patches;
  std::vector<Vec3> rest;  ///< [m, map frame] points on no plane
  Bytes rest_color;        ///< of `rest`, stride of the colour channel each; empty without colour
};

/// Reads either form; patches[i].points and rest.size() add up to `count`.
/// @param with_rest  false: `rest` is left empty (not decoded, nor checked).
/// Errors: Truncated, Malformed, LimitExceeded, InvalidArgument (the schema keeps what this codec cannot).
[[nodiscard]] Result<Content> read_content(ByteSpan bytes, std::uint64_t count, const MapSchema& schema,
                                           const DecodeLimits& limits, bool with_rest);

/// The raw form after its first byte.
[[nodiscard]] Result<Content> read_raw_content(ByteSpan bytes, std::uint64_t count, const MapSchema& schema);

/// Normal, offset and area from the triangles.
void complete_patch(PlanarPatch& patch);

}  // namespace mapcodec::paper
