// SPDX-License-Identifier: GPL-3.0-or-later
// Decoder of the `paper` codec (FORMAT.md 7) [Morell, Orts, Cazorla, Garcia-Rodriguez 2014, Algorithm 2].
#pragma once

#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/cloud/planar_patch.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// Decodes one `paper` geometry section: the stored points, then points drawn uniformly inside the triangles
/// of each plane, from a generator seeded with the plane's number: the same bytes give the same points
/// everywhere.
/// @param bytes  may be hostile.
/// @param count  points that the tile's header declares; exactly as many are returned.
/// @return points [m, map frame] laid out as schema.layout(): colour where kept, constants filled in.
/// Errors: Truncated, Malformed, LimitExceeded, InvalidArgument (the schema keeps a channel other than
/// colour). Threads: pure.
[[nodiscard]] Result<PointCloud> decode_paper(ByteSpan bytes, std::uint64_t count, const MapSchema& schema,
                                              const DecodeLimits& limits = {});

/// The planes alone, with their triangles, colours and point counts; no point is drawn. Arguments, errors: as
/// above.
[[nodiscard]] Result<std::vector<PlanarPatch>> read_paper_patches(ByteSpan bytes, std::uint64_t count,
                                                                  const MapSchema& schema,
                                                                  const DecodeLimits& limits = {});

}  // namespace mapcodec
