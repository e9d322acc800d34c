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
/// @param levels   binary levels of the tree to decode (three halve a cell on all axes): what is divided
/// further is
///                 spread over its surface as it stands there, with the same number of points. Fewer are
///                 faster. Channels only fit all of them.
/// @return `voxels` in Morton order, equal ones adjacent; empty if the tile was written without (no
/// channels). Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<DecodedPoints> decode_surface(ByteSpan bytes, std::uint64_t count,
                                                   const Quantizer& lattice, const DecodeLimits& limits,
                                                   unsigned levels = kAllSurfaceLevels);

}  // namespace mapcodec
