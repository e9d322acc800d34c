// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/codec/paper_mesh.hpp"

namespace mapcodec::paper {

/// Decodes what encode_planes wrote; triangles come in coded order, with their share of the plane's points.
/// @param bytes       may be hostile.
/// @param planes      how many, at most max_points.
/// @param max_bytes   memory that may be taken.
/// @param max_points  the planes' points together are at most this many; a plane has no more triangles than
/// points. Errors: Truncated, Malformed, which a breach of a cap shows as. Threads: pure.
[[nodiscard]] Result<std::vector<LatticePlane>> decode_planes(ByteSpan bytes, std::uint64_t planes,
                                                              std::uint64_t max_points,
                                                              std::uint64_t max_bytes,
                                                              std::uint32_t color_step,
                                                              std::uint32_t max_color);

}  // namespace mapcodec::paper
