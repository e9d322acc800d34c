// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "mapcodec/attribute/value_plan.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/geometry/voxel.hpp"

namespace mapcodec {

/// Decodes a "values" section (FORMAT.md 8.3).
/// Errors: Truncated, Malformed, LimitExceeded. Threads: pure.
[[nodiscard]] Result<Channel> decode_values(ByteSpan bytes, const ChannelInfo& info,
                                            std::span<const VoxelCoord> voxels, const DecodeLimits& limits);

/// The value (as ordered_bits) that integer `u` of a plan stands for. `u` <= plan.most_coded().
[[nodiscard]] std::uint64_t plan_value(const ComponentPlan& plan, ScalarType scalar, std::uint64_t u);

}  // namespace mapcodec
