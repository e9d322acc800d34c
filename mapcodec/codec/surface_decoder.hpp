// SPDX-License-Identifier: GPL-3.0-or-later
// Decoder of the `surface` geometry (FORMAT.md 10).
#pragma once

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/codec/points_decoder.hpp"
#include "mapcodec/geometry/quantizer.hpp"

namespace mapcodec {

inline constexpr unsigned kAllSurfaceLevels = ~0u;

/// Decodes what encode_surface wrote.
/// @param bytes    may be hostile.
/// @param count    points that the tile's header declares.
/// @param lattice  step_m is the surface step; points lie on a lattice of a 512th of it.
/// @param levels   binary levels of the tree to decode, rounded down to thirds (three halve a cell on all
///                 axes): cells that are divided further are spread over their surface as it stands there, or
///                 one through the occupied cells around, with the same number of points. Fewer are faster
///                 and need fewer bytes (surface_level_bytes). Channels only fit all of them.
/// @return `voxels` in Morton order, equal ones adjacent; empty if the tile was written without (no
/// channels). Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<DecodedPoints> decode_surface(ByteSpan bytes, std::uint64_t count,
                                                   const Quantizer& lattice, const DecodeLimits& limits,
                                                   unsigned levels = kAllSurfaceLevels);

/// How many bytes, from the first, decode_surface needs for 0, 3, 6, ... levels: never falling, and the last
/// number is enough for all further levels. Takes decoding the tree without its points.
/// Arguments, errors, threads: as above.
[[nodiscard]] Result<std::vector<std::uint64_t>> surface_level_bytes(ByteSpan bytes, std::uint64_t count,
                                                                     const DecodeLimits& limits = {});

}  // namespace mapcodec
