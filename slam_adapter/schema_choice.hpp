// SPDX-License-Identifier: GPL-3.0-or-later
// From what was asked and what the source holds to the schema of the map.
#pragma once

#include "mapcodec/cloud/map_schema.hpp"
#include "parallel/survey.hpp"
#include "slam_adapter/compress.hpp"

namespace mapcodec {

/// InvalidArgument, naming it, if a number of `options` is not finite or has a sign that makes no sense.
/// Ranges that depend on the cloud are checked later.
[[nodiscard]] Status check_numbers(const CompressOptions& options);

/// Decides lattice and channels. What will not be kept as asked is added to `warnings`.
/// Errors: InvalidArgument (unknown channel name); Empty (no finite point).
[[nodiscard]] Result<MapSchema> choose_schema(const Survey& survey, const CompressOptions& options,
                                              const Vec3& origin, double tile_size_m,
                                              std::vector<std::string>& warnings);

}  // namespace mapcodec
